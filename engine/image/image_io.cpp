#include "engine/image/image_io.h"

#include <dlfcn.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <new>

#include "engine/base/file.h"
#include "engine/image/oiio_module.h"

namespace stipple::image {
namespace {

struct Module {
    decltype(&stippleOiioEncode) encode = nullptr;
    decltype(&stippleOiioRead) read = nullptr;
    decltype(&stippleOiioDecode) decode = nullptr;
    decltype(&stippleOiioReadFloat) readFloat = nullptr;
    std::string problem;
};

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
        std::error_code ignored;
        const auto folder = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
        // Beside the program (build tree), in lib/stipple of an installation, or where the build put it (tests).
        for (const std::string& place :
             {(folder / "libstipple_oiio.so").string(), (folder / STIPPLE_INSTALLED_MODULE).string(),
              std::string(STIPPLE_BUILT_MODULE)}) {
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

Result<void> checkImagePath(const std::string& path) {
    if (hasExtension(path, ".png") || hasExtension(path, ".exr")) return {};
    return fail(ErrorKind::usage, "pictures are written as .png or .exr", path, "change the extension");
}

Result<std::vector<char>> encodeImage(const std::string& path, const render::Image& image) {
    STIPPLE_TRY(checkImagePath(path));
    const bool isExr = hasExtension(path, ".exr");
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

Result<void> writeImage(const std::string& path, const render::Image& image) {
    STIPPLE_ASSIGN(const std::vector<char> bytes, encodeImage(path, image));
    return writeWholeFile(path, bytes.data(), bytes.size());
}

namespace {

/// Size first, then pixels: `call` is either way to read.
template <typename Call>
Result<render::Image> readWith(const std::string& name, Call call) {
    if (!module().read) return fail(ErrorKind::input, "the picture module cannot be loaded: " + module().problem, name);
    std::array<char, 512> error{};
    int width = 0, height = 0;
    const auto bad = [&] {
        const std::string text = error.data();
        return fail(ErrorKind::input, "cannot be read: " + text.substr(0, text.find('\n')), name,
                    "is it a whole picture?");
    };
    if (call(&width, &height, nullptr, error.data(), static_cast<int>(error.size())) != 0) return bad();
    if (width <= 0 || height <= 0 || int64_t{width} * height > int64_t{1} << 30)
        return fail(ErrorKind::input, "has an impossible size", name);
    render::Image image;
    image.width = static_cast<uint32_t>(width);
    image.height = static_cast<uint32_t>(height);
    image.rgba.resize(size_t{image.width} * image.height);
    auto* pixels = reinterpret_cast<unsigned char*>(image.rgba.data());
    if (call(&width, &height, pixels, error.data(), static_cast<int>(error.size())) != 0) return bad();
    return image;
}

}  // namespace

Result<render::Image> readImage(const std::string& path) {
    return readWith(path, [&](int* w, int* h, unsigned char* pixels, char* error, int bytes) {
        return module().read(path.c_str(), w, h, pixels, error, bytes);
    });
}

Result<render::Image> decodeImage(const std::vector<uint8_t>& bytes, const std::string& name) {
    const bool isJpeg = bytes.size() > 2 && bytes[0] == 0xff && bytes[1] == 0xd8;
    const bool isWebp = bytes.size() > 11 && std::memcmp(bytes.data() + 8, "WEBP", 4) == 0;
    const char* const format = isJpeg ? "jpeg" : isWebp ? "webp" : "png";
    return readWith(name, [&](int* w, int* h, unsigned char* pixels, char* error, int count) {
        return module().decode(format, bytes.data(), bytes.size(), w, h, pixels, error, count);
    });
}

Result<render::HdrImage> readHdr(const std::string& path) {
    if (!module().readFloat)
        return fail(ErrorKind::input, "the picture module cannot be loaded: " + module().problem, path);
    std::array<char, 512> error{};
    int width = 0, height = 0;
    const auto bad = [&] {
        const std::string text = error.data();
        return fail(ErrorKind::input, "cannot be read: " + text.substr(0, text.find('\n')), path,
                    "is it a whole picture?");
    };
    const auto bytes = static_cast<int>(error.size());
    if (module().readFloat(path.c_str(), &width, &height, nullptr, error.data(), bytes) != 0) return bad();
    if (width <= 0 || height <= 0 || int64_t{width} * height > int64_t{1} << 28)
        return fail(ErrorKind::input, "has an impossible size", path);
    render::HdrImage image;
    image.width = static_cast<uint32_t>(width);
    image.height = static_cast<uint32_t>(height);
    image.rgb.resize(size_t{image.width} * image.height * 3);
    if (module().readFloat(path.c_str(), &width, &height, image.rgb.data(), error.data(), bytes) != 0) return bad();
    return image;
}

}  // namespace stipple::image
