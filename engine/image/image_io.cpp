#include "engine/image/image_io.h"

#include <dlfcn.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <new>

#include "engine/base/file.h"
#include "engine/base/own_places.h"
#include "engine/base/process.h"
#include "engine/image/oiio_module.h"
#include "engine/image/png_check.h"

namespace stipple::image {
namespace {

struct Module {
    decltype(&stippleOiioEncode) encode = nullptr;
    decltype(&stippleOiioRead) read = nullptr;
    decltype(&stippleOiioDecode) decode = nullptr;
    decltype(&stippleOiioReadFloat) readFloat = nullptr;
    std::string problem;
};

std::vector<std::string> modulePlaces() {
    return ownPlaces("libstipple_oiio.so", STIPPLE_INSTALLED_MODULE, STIPPLE_BUILT_MODULE);
}

/// Under a limit of address space: some of the module's 261 libraries end the program where they find none for their
/// threads and tables.
void requireAddressSpace() {
    constexpr uint64_t kNeeded = uint64_t{768} << 20;
    rlimit limit{};
    if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return;
    uint64_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const uint64_t used = pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
    if (limit.rlim_cur < used + kNeeded) throw std::bad_alloc();
}

const Module& module() {
    static const Module loaded = [] {
        requireAddressSpace();
        Module m;
        for (const std::string& place : modulePlaces()) {
            void* handle = ::dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
            if (!handle) {
                m.problem = ::dlerror();
                continue;
            }
            m.encode = reinterpret_cast<decltype(m.encode)>(::dlsym(handle, "stippleOiioEncode"));
            m.read = reinterpret_cast<decltype(m.read)>(::dlsym(handle, "stippleOiioRead"));
            m.decode = reinterpret_cast<decltype(m.decode)>(::dlsym(handle, "stippleOiioDecode"));
            m.readFloat = reinterpret_cast<decltype(m.readFloat)>(::dlsym(handle, "stippleOiioReadFloat"));
            if (m.encode && m.read && m.decode && m.readFloat) return m;
        }
        return m;
    }();
    return loaded;
}

bool hasExtension(const std::string& path, const char* extension) {
    std::string e = std::filesystem::path(path).extension().string();
    for (char& c : e) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return e == extension;
}

}  // namespace

Result<void> checkModule(bool load) {
    const auto missing = [](const std::string& why) {
        return fail(ErrorKind::output, "the picture module cannot be loaded: " + why, "",
                    "install the program anew, with the packages that it names");
    };
    const std::vector<std::string> places = modulePlaces();
    std::error_code ignored;
    if (std::none_of(places.begin(), places.end(), [&](const auto& p) { return std::filesystem::exists(p, ignored); }))
        return missing(places[0] + " is not there");
    if (load && !module().encode) return missing(module().problem);
    return {};
}

Result<void> checkImagePath(const std::string& path) {
    if (path.empty()) return fail(ErrorKind::usage, "the name of the picture to write is empty", "", "e.g. scan.png");
    if (hasExtension(path, ".png") || hasExtension(path, ".exr")) return {};
    return fail(ErrorKind::usage, "pictures are written as .png or .exr", path, "change the extension");
}

Result<std::vector<char>> encodeImage(const std::string& path, const render::Image& image, Transfer transfer) {
    STIPPLE_TRY(checkImagePath(path));
    const bool isExr = hasExtension(path, ".exr");
    if (!isExr && transfer == Transfer::rec709) {
        render::Image encoded;
        encoded.width = image.width;
        encoded.height = image.height;
        encoded.rgba = image.rgba;
        encodeRec709(encoded);
        STIPPLE_ASSIGN(std::vector<char> bytes, encodeImage(path, encoded, Transfer::srgb));
        tagRec709(bytes);
        return bytes;
    }
    const size_t pixels = size_t{image.width} * image.height;
    std::vector<float> wide;
    if (isExr) {
        wide.resize(pixels * 8);
        for (size_t i = 0; i < pixels; ++i) {
            float* to = wide.data() + i * 8;
            for (size_t c = 0; c < 3; ++c) to[c] = image.linear.size() == pixels * 3 ? image.linear[i * 3 + c] : 0;
            to[3] = static_cast<float>(image.rgba[i] >> 24) / 255.0f;
            to[4] = image.depth.size() == pixels ? image.depth[i] : 0;
            for (size_t c = 0; c < 3; ++c) to[5 + c] = image.normal.size() == pixels * 3 ? image.normal[i * 3 + c] : 0;
        }
    }
    if (!module().encode)
        return fail(ErrorKind::output, "the picture module cannot be loaded: " + module().problem, path);
    static const std::array<const char*, 8> names{"R", "G", "B", "A", "Z", "N.x", "N.y", "N.z"};
    std::array<char, 512> error{};
    std::vector<char> bytes;
    const auto sink = [](void* user, const void* data, unsigned long count) {
        const auto* from = static_cast<const char*>(data);
        static_cast<std::vector<char>*>(user)->assign(from, from + count);
    };
    const int status =
        module().encode(path.c_str(), static_cast<int>(image.width), static_cast<int>(image.height), isExr ? 8 : 4,
                        isExr ? 1 : 0, isExr ? static_cast<const void*>(wide.data()) : image.rgba.data(), names.data(),
                        sink, &bytes, error.data(), error.size());
    if (status != 0 || bytes.empty()) {
        const std::string reason = error.data();
        return fail(ErrorKind::output, "cannot be encoded: " + reason.substr(0, reason.find('\n')), path);
    }
    return bytes;
}

Result<void> writeImage(const std::string& path, const render::Image& image, Transfer transfer) {
    STIPPLE_ASSIGN(const std::vector<char> bytes, encodeImage(path, image, transfer));
    return writeWholeFile(path, bytes.data(), bytes.size());
}

namespace {

/// What stands at the beginning of a picture, and what it can be at most.
struct Promise {
    const char* format = "png";
    uint64_t bytes = 0;  ///< of the file
    double mostPixels = HUGE_VAL;
    uint64_t wholeBytes = 0;  ///< for each pixel: of what the library decodes as a whole; 0: as many as are made of it
    ReadAt readAt{};          ///< of a PNG
};

/// Whatever is wrong with a PNG, before its library prints it: up to the pixels, or `wholly`.
Result<void> checkPng(const Promise& promise, const std::string& name, bool wholly) {
    if (!promise.readAt) return {};
    STIPPLE_ASSIGN(const std::string fault, faultOfPng(promise.bytes, promise.readAt, wholly));
    if (fault.empty()) return {};
    return fail(ErrorKind::input, fault, name, "is it a whole picture?");
}

/// An interlaced PNG is decoded as a whole, with the samples that it has; all others by rows. (PNG, 11.2.1)
uint64_t wholeBytesOfPng(const uint8_t* head, size_t count) {
    if (count < 29 || head[28] == 0) return 0;
    const uint64_t channels = head[25] == 0 ? 1 : head[25] == 2 ? 3 : head[25] == 4 ? 2 : 4;  // a palette: of colours
    return channels * (head[24] == 16 ? 2 : 1) + 1;                                           // alpha that a chunk adds
}

bool isPng(const uint8_t* head, size_t count) { return count >= 4 && std::memcmp(head, "\x89PNG", 4) == 0; }

Promise promiseOf(const uint8_t* head, size_t count, uint64_t fileBytes) {
    const auto begins = [&](const char* with, size_t at = 0) {
        const size_t n = std::strlen(with);
        return count >= at + n && std::memcmp(head + at, with, n) == 0;
    };
    const auto bytes = static_cast<double>(fileBytes);
    // Deflate makes at most 1032 bytes of one, with 8 pixels each; an MCU of a JPEG takes six bits at least (and is
    // given some more leave); a row of an HDR file four bytes.
    if (begins("\xff\xd8")) return {"jpeg", fileBytes, 4000 * bytes};
    if (begins("WEBP", 8)) return {"webp", fileBytes, HUGE_VAL};
    if (begins("#?")) return {"hdr", fileBytes, static_cast<double>(int64_t{1} << 18) * bytes / 4};
    if (begins("\x89PNG")) return {"png", fileBytes, 8 * 1032 * bytes, wholeBytesOfPng(head, count)};
    return {"png", fileBytes, HUGE_VAL};
}

/// Is a picture of this size possible, and is there memory for `bytesOfPixel` of each pixel and once more for who
/// decodes it?
Result<void> checkSize(int64_t width, int64_t height, uint64_t bytesOfPixel, const Promise& promise,
                       const std::string& name, uint64_t memoryBytes) {
    constexpr int64_t kWidest = int64_t{1} << 18;
    if (width <= 0 || height <= 0 || width > kWidest || height > kWidest)
        return fail(ErrorKind::input, fmt::format("has an impossible size: {}x{}", width, height), name);
    if (static_cast<double>(width) * static_cast<double>(height) > promise.mostPixels)
        return fail(ErrorKind::input,
                    fmt::format("says that it is {}x{}, which {} bytes cannot be", width, height, promise.bytes), name,
                    "is it a whole picture?");
    const uint64_t needed =
        static_cast<uint64_t>(width * height) * (bytesOfPixel + std::max(bytesOfPixel, promise.wholeBytes));
    if (needed <= memoryBytes) return {};
    return fail(ErrorKind::budget,
                fmt::format("a picture of {}x{} takes about {}, but {} are left for it", width, height,
                            humanBytes(needed), humanBytes(memoryBytes)),
                name, "give more --memory, or make the picture smaller");
}

/// WebP files are decoded when they are opened: their size is read here. (RFC 9649; 0: not known)
glm::ivec2 webpSize(const std::vector<uint8_t>& b) {
    const auto is = [&](const char* form) { return std::memcmp(b.data() + 12, form, 4) == 0; };
    const auto word = [&](size_t at, int bytes) {
        int v = 0;
        for (int k = 0; k < bytes; ++k) v |= static_cast<int>(b[at + static_cast<size_t>(k)]) << (8 * k);
        return v;
    };
    if (b.size() < 30) return glm::ivec2(0);
    if (is("VP8X")) return {word(24, 3) + 1, word(27, 3) + 1};
    if (is("VP8L")) return {(word(21, 2) & 0x3fff) + 1, (word(22, 3) >> 6 & 0x3fff) + 1};
    if (is("VP8 ")) return {word(26, 2) & 0x3fff, word(28, 2) & 0x3fff};
    return glm::ivec2(0);
}

/// What the module says, without its library's own words.
std::string plainReason(const std::string& text) {
    if (text.ends_with(kStippleOiioFilesOnly)) return text;
    if (text.find("OpenImageIO") != std::string::npos || text.find("format reader") != std::string::npos)
        return "is no picture that can be read (.png, .jpg, .webp, .exr, .hdr)";
    return "cannot be read: " + text.substr(0, text.find('\n'));
}

/// Size first, then pixels: `call` is either way to read. `make` gives room for them.
template <typename Pixel, typename Call, typename Make>
Result<void> readWith(const std::string& name, const Promise& promise, uint64_t bytesOfPixel, uint64_t memoryBytes,
                      const Call& call, const Make& make) {
    std::array<char, 512> error{};
    int width = 0, height = 0;
    const auto read = [&](Pixel* pixels) -> Result<void> {
        const int status = call(&width, &height, pixels, error.data(), static_cast<int>(error.size()));
        if (status == 0) return {};
        if (status == kStippleOiioNoMemory)
            return fail(ErrorKind::budget, "does not fit in memory", name, "close other programs, or make it smaller");
        return fail(ErrorKind::input, plainReason(error.data()), name, "is it a whole picture?");
    };
    STIPPLE_TRY(checkPng(promise, name, false));
    STIPPLE_TRY(read(nullptr));
    STIPPLE_TRY(checkSize(width, height, bytesOfPixel, promise, name, memoryBytes));
    STIPPLE_TRY(checkPng(promise, name, true));
    return read(make(static_cast<uint32_t>(width), static_cast<uint32_t>(height)));
}

template <typename Call>
Result<render::Image> readRgba(const std::string& name, const Promise& promise, uint64_t memoryBytes,
                               const Call& call) {
    if (!module().read) return fail(ErrorKind::input, "the picture module cannot be loaded: " + module().problem, name);
    render::Image image;
    STIPPLE_TRY((readWith<unsigned char>(name, promise, 4, memoryBytes, call, [&](uint32_t w, uint32_t h) {
        image.width = w;
        image.height = h;
        image.rgba.resize(size_t{w} * h);
        return reinterpret_cast<unsigned char*>(image.rgba.data());
    })));
    return image;
}

/// Of bytes that outlive the promise.
Result<Promise> promiseOfSource(const ByteSource& file) {
    std::array<uint8_t, 64> head{};
    const auto count = static_cast<size_t>(std::min<uint64_t>(head.size(), file.sizeBytes()));
    if (count == 0) return fail(ErrorKind::input, "is empty", file.path(), "is the download complete?");
    STIPPLE_TRY(file.readAt(0, head.data(), count));
    Promise promise = promiseOf(head.data(), count, file.sizeBytes());
    if (isPng(head.data(), count))
        promise.readAt = [&file](uint64_t at, void* to, size_t n) { return file.readAt(at, to, n); };
    return promise;
}

/// WebP is decoded when it is opened.
Result<void> checkWebp(const std::vector<uint8_t>& bytes, const Promise& promise, const std::string& name,
                       uint64_t memoryBytes) {
    const glm::ivec2 size = std::strcmp(promise.format, "webp") == 0 ? webpSize(bytes) : glm::ivec2(0);
    if (size.x <= 0) return {};
    return checkSize(size.x, size.y, 4, promise, name, memoryBytes);
}

/// A picture's bytes as a whole, for a library that reads files and memory only. Takes them from the memory allowed.
Result<std::vector<uint8_t>> wholeOf(const ByteSource& file, uint64_t& memoryBytes) {
    if (file.sizeBytes() > memoryBytes)
        return fail(ErrorKind::budget,
                    fmt::format("its {} are read as a whole, but {} are left for it", humanBytes(file.sizeBytes()),
                                humanBytes(memoryBytes)),
                    file.path(), "give more --memory, or make the picture smaller");
    std::vector<uint8_t> bytes(file.sizeBytes());
    STIPPLE_TRY(file.readAt(0, bytes.data(), bytes.size()));
    memoryBytes -= bytes.size();
    return bytes;
}

Result<render::HdrImage> readFloats(const std::string& path, const std::vector<uint8_t>* bytes, const Promise& promise,
                                    uint64_t memoryBytes) {
    if (!module().readFloat)
        return fail(ErrorKind::input, "the picture module cannot be loaded: " + module().problem, path);
    render::HdrImage image;
    const auto call = [&](int* w, int* h, float* pixels, char* error, int errorBytes) {
        return module().readFloat(path.c_str(), bytes ? bytes->data() : nullptr, bytes ? bytes->size() : 0, w, h,
                                  pixels, error, errorBytes);
    };
    STIPPLE_TRY((readWith<float>(path, promise, 3 * sizeof(float), memoryBytes, call, [&](uint32_t w, uint32_t h) {
        image.width = w;
        image.height = h;
        image.rgb.resize(size_t{w} * h * 3);
        return image.rgb.data();
    })));
    return image;
}

}  // namespace

Result<render::Image> readImage(const std::string& path, uint64_t memoryBytes) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));  // (the library would wait for ever at a FIFO)
    STIPPLE_ASSIGN(const Promise promise, promiseOfSource(file));
    return readRgba(path, promise, memoryBytes, [&](int* w, int* h, unsigned char* pixels, char* error, int count) {
        return module().read(path.c_str(), nullptr, 0, w, h, pixels, error, count);
    });
}

Result<render::Image> readImage(const ByteSource& file, uint64_t memoryBytes) {
    STIPPLE_ASSIGN(const Promise promise, promiseOfSource(file));
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, wholeOf(file, memoryBytes));
    STIPPLE_TRY(checkWebp(bytes, promise, file.path(), memoryBytes));
    return readRgba(
        file.path(), promise, memoryBytes, [&](int* w, int* h, unsigned char* pixels, char* error, int count) {
            return module().read(file.path().c_str(), bytes.data(), bytes.size(), w, h, pixels, error, count);
        });
}

Result<render::Image> decodeImage(const std::vector<uint8_t>& bytes, const std::string& name, uint64_t memoryBytes) {
    Promise promise = promiseOf(bytes.data(), bytes.size(), bytes.size());
    if (isPng(bytes.data(), bytes.size()))
        promise.readAt = [&](uint64_t at, void* to, size_t n) -> Result<void> {
            std::memcpy(to, bytes.data() + at, n);
            return {};
        };
    STIPPLE_TRY(checkWebp(bytes, promise, name, memoryBytes));
    return readRgba(name, promise, memoryBytes, [&](int* w, int* h, unsigned char* pixels, char* error, int count) {
        return module().decode(promise.format, bytes.data(), bytes.size(), w, h, pixels, error, count);
    });
}

Result<render::HdrImage> readHdr(const std::string& path, uint64_t memoryBytes) {
    STIPPLE_ASSIGN(const InputFile file, InputFile::open(path));
    STIPPLE_ASSIGN(const Promise promise, promiseOfSource(file));
    return readFloats(path, nullptr, promise, memoryBytes);
}

Result<render::HdrImage> readHdr(const ByteSource& file, uint64_t memoryBytes) {
    STIPPLE_ASSIGN(const Promise promise, promiseOfSource(file));
    STIPPLE_ASSIGN(const std::vector<uint8_t> bytes, wholeOf(file, memoryBytes));
    STIPPLE_TRY(checkWebp(bytes, promise, file.path(), memoryBytes));
    return readFloats(file.path(), &bytes, promise, memoryBytes);
}

}  // namespace stipple::image
