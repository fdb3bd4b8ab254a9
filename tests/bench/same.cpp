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
#include "tests/support/support.h"

namespace stipple::test {
namespace {

template <typename T>
void add(uint64_t& hash, const std::vector<T>& values) {
    const uint64_t count = values.size();
    hash = hashBytes(&count, sizeof(count), hash);
    hash = hashBytes(values.data(), values.size() * sizeof(T), hash);
}

template <typename... T>
void addFields(uint64_t& hash, const T&... fields) {
    ((hash = hashBytes(&fields, sizeof(fields), hash)), ...);
}

/// Of every chunk and every attribute stream, in the order of the nodes.
uint64_t hashRecords(const lod::Store& store) {
    uint64_t hash = 0;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t i = 0; i < h.chunks(); ++i) {
        const auto chunk = lod::readChunk(store, i, true);
        if (!chunk) throw std::runtime_error(chunk.error().line());
        add(hash, chunk->records);
        add(hash, chunk->lowBits);
        add(hash, chunk->vertices);
        add(hash, chunk->triangles);
        add(hash, chunk->clusters);
        add(hash, chunk->segments);
        add(hash, chunk->texels);
        if (i >= h.nodes.size() || h.nodes[i].attributeBytes == 0) continue;
        for (size_t k = 0; k < store.description.attributes.size(); ++k) {
            const auto values = lod::readAttribute(store, i, k);
            if (!values) throw std::runtime_error(values.error().line());
            add(hash, *values);
        }
    }
    return hash;
}

/// Of what the cut reads of the nodes: spheres, errors, counts, places; not where chunks lie in the file.
uint64_t hashTable(const lod::Store& store) {
    const lod::Hierarchy& h = store.hierarchy;
    uint64_t hash = 0;
    addFields(hash, h.origin, h.unit, h.rootLog2, h.errors.smallest);
    for (const lod::Node& n : h.nodes)
        addFields(hash, n.centre, n.radius, n.parent, n.firstChild, n.records, n.cell, n.level, n.childMask,
                  n.errorCode, n.stepShift, n.normalCone, n.normalConeCosine);
    return hash;
}

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
