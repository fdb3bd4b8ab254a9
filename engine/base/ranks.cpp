#include "engine/base/ranks.h"

#include <array>

namespace stipple {

Result<void> agree(Ranks* ranks, const Result<void>& mine) {
    if (ranks == nullptr) return mine;
    // Kind, then three texts that end in zeros; nothing: all is well.
    std::vector<uint8_t> bytes;
    if (!mine) {
        bytes.push_back(static_cast<uint8_t>(mine.error().kind));
        for (const std::string* text : {&mine.error().what, &mine.error().where, &mine.error().hint}) {
            bytes.insert(bytes.end(), text->begin(), text->end());
            bytes.push_back(0);
        }
    }
    for (const std::vector<uint8_t>& theirs : ranks->gather(bytes)) {
        if (theirs.empty()) continue;
        std::array<std::string, 3> texts;
        size_t t = 0;
        for (size_t i = 1; i < theirs.size() && t < texts.size(); ++i) {
            if (theirs[i] == 0)
                ++t;
            else
                texts.at(t).push_back(static_cast<char>(theirs[i]));
        }
        return tl::unexpected(Error{static_cast<ErrorKind>(theirs[0]), texts[0], texts[1], texts[2]});
    }
    return {};
}

}  // namespace stipple
