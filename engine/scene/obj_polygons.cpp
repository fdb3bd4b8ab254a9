#include "engine/scene/obj_polygons.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "engine/scene/polygon.h"

namespace stipple::scene {
namespace {

constexpr size_t kMostCorners = 64;             ///< that the library may take apart
constexpr size_t kShortest = 2 * kMostCorners;  ///< of a line that may hold more

std::vector<std::string_view> wordsOf(std::string_view line) {
    std::vector<std::string_view> words;
    for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != std::string_view::npos;) {
        const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
        words.push_back(line.substr(at, end - at));
        at = end;
    }
    return words;
}

bool isOf(std::string_view line, char what) {
    const size_t at = line.find_first_not_of(" \t");
    return at != std::string_view::npos && at + 1 < line.size() && line[at] == what &&
           (line[at + 1] == ' ' || line[at + 1] == '\t');
}

bool isLargeFace(std::string_view line) {
    return line.size() >= kShortest && isOf(line, 'f') && wordsOf(line).size() > kMostCorners + 1;
}

template <typename Number>
Number numberOf(std::string_view word, Number otherwise) {
    if (!word.empty() && word[0] == '+') word.remove_prefix(1);
    std::from_chars(word.data(), word.data() + word.size(), otherwise);
    return otherwise;
}

}  // namespace

Result<bool> hasLargeFaces(const ByteSource& file) {
    std::string block(size_t{1} << 20, '\0'), line;  // the line that a block ends in
    for (uint64_t at = 0; at < file.sizeBytes();) {
        const size_t count = static_cast<size_t>(std::min<uint64_t>(block.size(), file.sizeBytes() - at));
        STIPPLE_TRY(file.readAt(at, block.data(), count));
        at += count;
        for (const char *p = block.data(), *end = p + count; p < end;) {
            const auto* stop = static_cast<const char*>(std::memchr(p, '\n', static_cast<size_t>(end - p)));
            const std::string_view part(p, static_cast<size_t>((stop != nullptr ? stop : end) - p));
            p = stop != nullptr ? stop + 1 : end;
            if (line.empty() && stop != nullptr) {
                if (isLargeFace(part)) return true;
                continue;
            }
            line += part;
            if (isLargeFace(line)) return true;
            if (stop != nullptr) line.clear();
        }
    }
    return false;
}

SplitFaces::int_type SplitFaces::underflow() {
    if (!std::getline(from_, line_)) return traits_type::eof();
    if (isOf(line_, 'v')) {
        const std::vector<std::string_view> words = wordsOf(line_);
        glm::dvec3 p(0);
        for (int c = 0; c < 3; ++c)
            if (static_cast<size_t>(c) + 1 < words.size()) p[c] = numberOf(words[static_cast<size_t>(c) + 1], 0.0);
        positions_.push_back(p);
    }
    if (isLargeFace(line_)) line_ = triangles(line_);
    line_ += '\n';
    setg(line_.data(), line_.data(), line_.data() + line_.size());
    return traits_type::to_int_type(line_[0]);
}

std::string SplitFaces::triangles(std::string_view line) const {
    const std::vector<std::string_view> words = wordsOf(line);
    std::vector<glm::dvec3> corners;
    bool isSound = true;
    for (size_t k = 1; k < words.size() && isSound; ++k) {
        const auto number = numberOf(words[k], int64_t{0}), count = static_cast<int64_t>(positions_.size());
        const int64_t index = number < 0 ? count + number : number - 1;  // backwards from here, or from 1
        isSound = index >= 0 && index < count;
        if (isSound) corners.push_back(positions_[static_cast<size_t>(index)]);
        if (!isSound) continue;
        const glm::dvec3 size = glm::abs(corners.back());
        isSound = size.x + size.y + size.z <= std::numeric_limits<float>::max();  // (NaN is not)
    }
    std::string text;
    const auto add = [&](size_t a, size_t b, size_t c) {
        text += "f ";
        for (const size_t k : {a, b, c}) (text += words[k + 1]) += ' ';
        text += '\n';
    };
    if (isSound)
        for (const auto& [a, b, c] : triangulatePolygon(corners)) add(a, b, c);
    else  // what is wrong with it is found corner by corner
        for (size_t k = 2; k + 1 < words.size(); ++k) add(0, k - 1, k);
    return text;
}

}  // namespace stipple::scene
