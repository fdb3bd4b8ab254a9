// What tests/bench/same_pictures.sh asks about pictures and stores.
//   stipple_same pictures FILE...   hash of the decoded values and name of each
//   stipple_same stores FILE...     hash of the decoded records, of the node table, and name of each
//   stipple_same compare A B        how far two pictures are apart, one line
//   stipple_same ball FILE          the points of the golden pictures, as PLY
//   stipple_same small FOLDER       the four small stores of the tests, built through the library
#include <fmt/format.h>

#include <cstring>
#include <filesystem>
#include <span>

#include "engine/base/hash.h"
#include "tests/support/crafted_store.h"
#include "tests/support/planes.h"
#include "tests/support/store_hash.h"
#include "tests/support/support.h"

namespace stipple::test {
namespace {

void hashStore(const std::string& path) {
    const auto store = lod::openStore(path);
    if (!store) {
        fmt::print("unreadable {}\n", path);
        return;
    }
    fmt::print("{} {} {}\n", hexDigits(hashRecords(*store)), hexDigits(hashTable(*store)), path);
}

void hashPicture(const std::string& path) {
    if (!std::filesystem::exists(path))
        fmt::print("missing {}\n", path);
    else
        fmt::print("{} {}\n", hexDigits(hashPlanes(readPlanes(path))), path);
}

void compare(const std::string& a, const std::string& b) {
    const PlanesDiffer d = comparePlanes(readPlanes(a), readPlanes(b));
    if (!d.areAlike)
        fmt::print("another size or other channels\n");
    else
        fmt::print("PSNR {:.2f} dB, largest difference {:.6g} (in {}), {} pixels\n", d.psnr, d.largest, d.largestIn,
                   d.pixels);
}

int run(std::span<char*> arguments) {
    const std::string command = arguments.size() > 1 ? arguments[1] : "";
    const auto files = arguments.subspan(std::min<size_t>(2, arguments.size()));
    if (command == "pictures" || command == "stores") {
        for (const char* file : files) command == "stores" ? hashStore(file) : hashPicture(file);
    } else if (command == "compare" && files.size() == 2) {
        compare(files[0], files[1]);
    } else if (command == "ball" && files.size() == 1) {
        writePly(files[0], bumpySphere(60'000, 1));
    } else if (command == "small" && files.size() == 1) {
        (void)smallStores(files[0]);
    } else {
        fmt::print(stderr, "usage: stipple_same pictures|stores FILE... | compare A B | ball FILE | small FOLDER\n");
        return 2;
    }
    return 0;
}

}  // namespace
}  // namespace stipple::test

int main(int argc, char** argv) {
    try {
        return stipple::test::run({argv, static_cast<size_t>(argc)});
    } catch (const std::exception& e) {
        fmt::print(stderr, "stipple_same: {}\n", e.what());
        return 3;
    }
}
