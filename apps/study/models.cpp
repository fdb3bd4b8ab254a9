#include "apps/study/models.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "engine/image/image_io.h"
#include "engine/scene/camera.h"
#include "lod/builder/build.h"
#include "lod/builder/mesh/mesh_build.h"
#include "lod/builder/patch_store/patch_store_build.h"
#include "lod/import/ply/mesh.h"
#include "lod/primitives/in_memory.h"

namespace stipple::study {
namespace {

namespace fs = std::filesystem;
using glm::dvec3;

/// A shell word of any path.
std::string quoted(const std::string& path) {
    std::string out = "'";
    for (const char c : path) out += c == '\'' ? "'\\''" : std::string(1, c);
    return out + "'";
}

Result<std::string> unpacked(const std::string& path, const std::string& folder) {
    const fs::path p(path);
    if (p.extension() != ".gz") return path;
    if (!fs::exists(path)) return fail(ErrorKind::input, "No such file or directory", path);
    const std::string out = (fs::path(folder) / p.stem()).string();
    if (fs::exists(out)) return out;
    const std::string command = fmt::format("gzip -dc {} > {}.part", quoted(path), quoted(out));
    if (std::system(command.c_str()) != 0) return fail(ErrorKind::input, "gzip cannot unpack it", path);
    std::error_code error;
    fs::rename(out + ".part", out, error);
    if (error) return fail(ErrorKind::output, error.message(), out);
    return out;
}

/// All triangles as one primitive.
Result<scene::Scene> sceneOfPly(const std::string& path, const std::string& folder) {
    STIPPLE_ASSIGN(const lod::MeshSource source, lod::openPlyMesh(path, uint64_t{1} << 30, folder));
    if (source.survey) STIPPLE_TRY(source.survey([](uint64_t, uint64_t) { return Result<void>(); }));
    scene::Scene scene;
    scene.path = path;
    scene::Primitive p;
    STIPPLE_TRY(source.read([&](const lod::TriangleMesh& block) -> Result<void> {
        const auto first = static_cast<uint32_t>(p.position.size());
        for (size_t i = 0; i < block.position.size(); ++i) {
            p.position.emplace_back(block.position[i]);
            p.normal.push_back(block.normal[i]);
            const auto linear = [&](uint32_t shift) {
                return shared::linearFromSrgb(static_cast<float>(block.colour[i] >> shift & 255u) / 255.0f);
            };
            p.colour.emplace_back(linear(0), linear(8), linear(16), 1.0f);
        }
        for (const uint32_t i : block.indices) p.indices.push_back(first + i);
        return {};
    }));
    scene.meshes.push_back({"", {std::move(p)}});
    scene.nodes.emplace_back();
    scene.nodes.back().mesh = 0;
    return scene;
}

double areaOf(const scene::Scene& scene) {
    double area = 0;
    const std::vector<glm::dmat4> world = scene.worldTransforms();
    for (size_t n = 0; n < scene.nodes.size(); ++n) {
        if (scene.nodes[n].mesh < 0) continue;
        for (const scene::Primitive& p : scene.meshes[static_cast<size_t>(scene.nodes[n].mesh)].primitives) {
            const auto at = [&](size_t i) { return dvec3(world[n] * glm::dvec4(p.at(p.indices[i]), 1)); };
            for (size_t i = 0; p.kind == scene::PrimitiveKind::triangles && i + 2 < p.indices.size(); i += 3)
                area += 0.5 * glm::length(glm::cross(at(i + 1) - at(i), at(i + 2) - at(i)));
        }
    }
    return area;
}

Result<std::shared_ptr<const lod::Store>> opened(const std::string& path) {
    STIPPLE_ASSIGN(lod::Store store, lod::openStore(path));
    return std::make_shared<const lod::Store>(std::move(store));
}

Result<std::shared_ptr<const lod::Store>> builtOf(const std::string& input, lod::BuildSettings settings,
                                                  const std::string& path, Executor& executor) {
    if (fs::exists(path))
        if (auto store = opened(path); store) return store;
    settings.leftovers = lod::Leftovers::replace;
    settings.isStopped = isStopRequested;
    Progress silent(false);
    STIPPLE_TRY(lod::buildStore({input}, path, settings, executor, silent));
    return opened(path);
}

Result<std::shared_ptr<const lod::Store>> built(const lod::PointSource& source, const std::string& path,
                                                Executor& executor) {
    lod::BuildSettings settings;
    settings.open = [&](const std::string&, const lod::ReadOptions&) -> Result<lod::PointSource> { return source; };
    return builtOf(source.info.path, std::move(settings), path, executor);
}

}  // namespace

Result<Surface> readSurface(const std::string& path, const std::string& folder) {
    Surface s;
    STIPPLE_ASSIGN(s.path, unpacked(path, folder));
    if (fs::path(s.path).extension() == ".ply") {
        STIPPLE_ASSIGN(s.scene, sceneOfPly(s.path, folder));
    } else {
        STIPPLE_ASSIGN(s.scene, scene::readScene(s.path));
    }
    for (const scene::EncodedImage& encoded : s.scene.images) {
        const auto image = image::decodeImage(encoded.bytes, encoded.name);
        scene::DecodedImage decoded;  // one that cannot be read counts as white
        if (image) decoded = {image->width, image->height, image->rgba};
        s.images.push_back(std::move(decoded));
    }
    s.area = areaOf(s.scene);
    if (!(s.area > 0)) return fail(ErrorKind::input, "has no triangles", path);
    return s;
}

Result<std::shared_ptr<const lod::Store>> surfelStore(const Surface& surface, uint64_t count, const std::string& path,
                                                      Executor& executor) {
    STIPPLE_ASSIGN(const lod::PointSource source, scene::sampleSurfels(surface.scene, surface.images, {count}));
    return built(source, path, executor);
}

lod::TriangleMesh meshOf(const Surface& surface) {
    lod::TriangleMesh mesh;
    for (const scene::Mesh& m : surface.scene.meshes)
        for (const scene::Primitive& p : m.primitives) {
            const auto first = static_cast<uint32_t>(mesh.position.size());
            for (size_t i = 0; i < p.position.size(); ++i) {
                mesh.position.push_back(p.at(i));
                mesh.normal.push_back(p.normal.empty() ? glm::vec3(0) : p.normal[i]);
                mesh.uv.emplace_back(0);
                mesh.colour.push_back(lod::kPlainColour | 0xff000000u);
                mesh.surface.push_back(p.normal.empty() ? shared::kSurfaceFlat : 0u);
            }
            for (const uint32_t i : p.indices) mesh.indices.push_back(first + i);
        }
    return mesh;
}

Result<std::shared_ptr<const lod::Store>> triangleStore(const Surface& surface, const std::string& path,
                                                        Executor& executor) {
    if (fs::exists(path))
        if (auto store = opened(path); store) return store;
    lod::MeshBuildSettings settings;
    settings.limits.leftovers = lod::Leftovers::replace;
    settings.description.up = {0, 1, 0};
    settings.description.materials.emplace_back();
    Progress silent(false);
    STIPPLE_TRY(lod::buildMeshStore(lod::sourceOf(meshOf(surface)), path, settings, executor, silent));
    return opened(path);
}

Result<std::shared_ptr<const lod::Store>> patchStore(const Surface& surface, const std::string& path,
                                                     Executor& executor) {
    if (fs::exists(path))
        if (auto store = opened(path); store) return store;
    lod::PatchBuildSettings settings;
    settings.limits.leftovers = lod::Leftovers::replace;
    settings.description.up = {0, 1, 0};
    Progress silent(false);
    STIPPLE_TRY(lod::buildPatchStore(lod::sourceOf(meshOf(surface)), path, settings, executor, silent));
    return opened(path);
}

Result<std::shared_ptr<const lod::Store>> scanStore(const std::string& file, const std::string& path,
                                                    Executor& executor) {
    return builtOf(file, {}, path, executor);
}

lod::PointBlock checkerPlane(uint32_t side, uint32_t cell) {
    lod::PointBlock block;
    const double step = 2.0 / side;
    for (uint32_t y = 0; y < side; ++y)
        for (uint32_t x = 0; x < side; ++x) {
            block.position.emplace_back((x + 0.5) * step - 1, (y + 0.5) * step - 1, 0);
            block.normal.emplace_back(0, 0, 1);
            block.colour.push_back((x / cell + y / cell) % 2 == 0 ? 0xffffffu : 0u);
        }
    return block;
}

lod::PointBlock unitSphere(uint64_t count) {
    lod::PointBlock block;
    for (uint64_t i = 0; i < count; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count),
                     r = std::sqrt(std::max(0.0, 1 - z * z)), angle = 2.399963229728653 * static_cast<double>(i);
        const dvec3 p(r * std::cos(angle), r * std::sin(angle), z);
        block.position.push_back(p);
        block.normal.emplace_back(p);
        block.colour.push_back(lod::kPlainColour);
    }
    return block;
}

Result<std::shared_ptr<const lod::Store>> pointStore(lod::PointBlock points, const std::string& path,
                                                     Executor& executor) {
    lod::SourceInfo info;
    info.path = fs::path(path).filename().string();
    info.format = "made";
    info.up = lod::UpAxis::z;
    return built(lod::pointsInMemory(std::move(info), std::move(points)), path, executor);
}

lod::View viewFrom(const dvec3& eye, const dvec3& target, const dvec3& up, uint32_t width, uint32_t height) {
    scene::Camera camera;
    camera.eye = eye;
    camera.target = target;
    camera.up = up;
    return scene::makeView(camera, width, height, 1e-12 * glm::length(target - eye));
}

lod::View fittedView(const lod::Store& store, uint32_t width, uint32_t height) {
    const lod::StoreDescription& d = store.description;
    const scene::Camera camera =
        scene::fitCamera(d.boundsMin, d.boundsMax, d.up, static_cast<double>(width) / static_cast<double>(height));
    return scene::makeView(camera, width, height, 1e-12 * glm::length(d.boundsMax - d.boundsMin));
}

}  // namespace stipple::study
