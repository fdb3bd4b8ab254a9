// The pictures of a scene file.
#include <set>

#include "engine/base/text.h"
#include "engine/image/image_io.h"
#include "engine/scene/open/open_scene.h"
#include "engine/scene/triangles.h"

namespace stipple::scene {
namespace {

/// What a texture without a picture is: factors count alone, normals stay as they are.
scene::DecodedImage plainImage(bool isNormalMap) { return {1, 1, {isNormalMap ? 0xffff8080u : 0xffffffffu}}; }

/// (The stores of one scene are built one after the other, each with all its pictures.)
void sayOnce(const Say& say, const std::string& line) {
    static std::set<std::string> said;
    if (say && said.insert(line).second) say(line);
}

}  // namespace

Result<std::vector<scene::DecodedImage>> decodeImages(const scene::Scene& scene, uint64_t memoryBytes, const Say& say) {
    std::vector<bool> isNormalMap(scene.images.size(), false);
    const std::vector<lod::TextureImage> kinds = scene::textureImages(scene);
    for (size_t t = 0; t < kinds.size(); ++t)
        if (scene.textures[t].image >= 0 && kinds[t].kind == lod::TextureKind::normal)
            isNormalMap[static_cast<size_t>(scene.textures[t].image)] = true;
    std::vector<scene::DecodedImage> images;
    uint64_t left = memoryBytes / 2;  // the other half is for what is made of them
    for (size_t i = 0; i < scene.images.size(); ++i) {
        const scene::EncodedImage& encoded = scene.images[i];
        if (encoded.bytes.empty()) {  // the reader has said so
            images.push_back(plainImage(isNormalMap[i]));
            continue;
        }
        auto image = image::decodeImage(encoded.bytes, scene.path + ": " + encoded.name, left);
        if (!image && image.error().kind == ErrorKind::budget) return tl::unexpected(image.error());
        if (!image) {
            sayOnce(say, "note: a texture is left out: " + printable(image.error().line()));
            images.push_back(plainImage(isNormalMap[i]));
            continue;
        }
        left -= std::min<uint64_t>(left, image->rgba.size() * sizeof(image->rgba[0]));
        images.push_back({image->width, image->height, std::move(image->rgba)});
    }
    return images;
}

}  // namespace stipple::scene
