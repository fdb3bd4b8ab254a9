// libFuzzer: any bytes as a chunk end in records or in an error; and any fields of a store, with hashes that are right,
// end in an error or in pictures.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "lod/store/chunk.h"
#include "tests/support/crafted_store.h"
#include "tests/support/support.h"

namespace {

using namespace stipple;

struct Known {
    test::CraftedStore crafted;
    std::shared_ptr<const lod::Store> store;
};

const std::vector<Known>& knownStores() {
    static const std::vector<Known> all = [] {
        static const test::TempFolder folder;
        std::vector<Known> out;
        for (const std::string& path : test::smallStores(folder.path()))
            out.push_back({test::CraftedStore::read(path), std::make_shared<const lod::Store>(*lod::openStore(path))});
        return out;
    }();
    return all;
}

void decodeAsItIs(const uint8_t* data, size_t size) {
    (void)lod::decodeChunk(data + 1, size - 1, data[0] + 1u, "fuzz", true);
    lod::MeshGroup group;
    group.vertices = data[0];
    group.clusters = 1 + data[0] / 64u;
    for (const auto kind : {lod::MeshVertices::shortOnes, lod::MeshVertices::counted, lod::MeshVertices::pairs})
        (void)lod::decodeMeshChunk(data + 1, size - 1, data[0] * 2u, group, kind, "fuzz");
    (void)lod::decodeCurveChunk(data + 1, size - 1, data[0] + 1u, "fuzz");
    (void)lod::decodeTile(data + 1, size - 1, "fuzz");
}

/// The bytes decide what is changed: eight at a time, and zeros when they are used up.
void craft(const uint8_t* data, size_t size) {
    static const std::string path = [] {
        static const test::TempFolder folder;
        return folder / "crafted.stipple";
    }();
    const Known& from = knownStores()[data[0] % knownStores().size()];
    size_t at = 1;
    const test::Dice dice = [&](uint64_t below) -> uint64_t {
        uint64_t value = 0;
        const size_t width = below <= 256     ? 1
                             : below <= 65536 ? 2
                                              : 8,
                     count = std::min(width, size - std::min(at, size));
        if (count > 0) std::memcpy(&value, data + at, count);
        at += count;
        return below == 0 ? 0 : value % below;
    };
    test::CraftedStore changed = from.crafted;
    (void)test::mutate(changed, *from.store, dice);
    changed.write(path);
    (void)test::tryEverything(path);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 2) return 0;
    if (data[0] % 2 == 0)
        decodeAsItIs(data + 1, size - 1);
    else
        craft(data + 1, size - 1);
    return 0;
}
