#include "tests/support/support.h"
#include <gtest/gtest.h>
#include <iterator>
#include "engine/cpu/cpu_backend.h"
#include "engine/cpu/kernels.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "engine/scene/camera.h"

namespace stipple::test {
namespace {

[[noreturn]] void fatal(const Error& error) { throw std::runtime_error(error.line()); }

}  // namespace

TempFolder::TempFolder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "stipple-test-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
    path_ = pattern;
}
TempFolder::~TempFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
}

std::vector<TestPoint> bumpySphere(size_t count, uint64_t seed, const glm::dvec3& centre) {
    Rng rng(seed);
    std::vector<TestPoint> points(count);
    for (TestPoint& p : points) {
        const glm::dvec3 n = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
        const double bump = 1 + 0.05 * std::sin(9 * n.x) * std::sin(8 * n.y) * std::sin(7 * n.z);
        p.position = centre + bump * n;
        p.normal = glm::vec3(n);
        const auto byte = [](double v) { return static_cast<uint32_t>(127.5 + 100 * v); };
        p.colour = byte(n.x) | byte(n.y) << 8 | byte(n.z) << 16;
    }
    return points;
}

void writePly(const std::string& path, const std::vector<TestPoint>& points, bool withNormals, bool withRadii) {
    std::ofstream out(path, std::ios::binary);
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
        << "\nproperty double x\nproperty double y\nproperty double z\n";
    if (withNormals) out << "property float nx\nproperty float ny\nproperty float nz\n";
    out << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    if (withRadii) out << "property float radius\n";
    out << "end_header\n";
    for (const TestPoint& p : points) {
        out.write(reinterpret_cast<const char*>(&p.position), 24);
        if (withNormals) out.write(reinterpret_cast<const char*>(&p.normal), 12);
        out.write(reinterpret_cast<const char*>(&p.colour), 3);
        if (withRadii) out.write(reinterpret_cast<const char*>(&p.radius), 4);
    }
}

void writeLas(const std::string& path, const std::vector<glm::ivec3>& points, double scale, const glm::dvec3& offset) {
    std::vector<char> header(227, 0);
    const auto put = [&](size_t at, auto value) { std::memcpy(header.data() + at, &value, sizeof(value)); };
    std::memcpy(header.data(), "LASF", 4);
    header[24] = 1;
    header[25] = 2;
    put(94, uint16_t{227});
    put(96, uint32_t{227});
    header[104] = 2;
    put(105, uint16_t{26});
    put(107, static_cast<uint32_t>(points.size()));
    for (size_t a = 0; a < 3; ++a) {
        put(131 + 8 * a, scale);
        put(155 + 8 * a, offset[static_cast<int>(a)]);
    }
    std::ofstream out(path, std::ios::binary);
    out.write(header.data(), static_cast<std::streamsize>(header.size()));
    for (const glm::ivec3& p : points) {
        std::array<char, 26> record{};
        std::memcpy(record.data(), &p, 12);
        const std::array<uint16_t, 3> rgb{0x8080, 0x4040, 0xc0c0};
        std::memcpy(record.data() + 20, rgb.data(), 6);
        out.write(record.data(), record.size());
    }
}

lod::BuildReport build(const std::vector<std::string>& inputs, const std::string& output, Executor& executor,
                       const lod::BuildSettings& settings) {
    Progress silent(false);
    auto report = lod::buildStore(inputs, output, settings, executor, silent);
    if (!report) fatal(report.error());
    return *report;
}

std::shared_ptr<const lod::Store> buildAndOpen(const std::string& input, const std::string& output, Executor& executor,
                                               uint32_t leafRecords) {
    lod::BuildSettings settings;
    settings.leafRecords = leafRecords;
    build({input}, output, executor, settings);
    auto store = lod::openStore(output);
    if (!store) fatal(store.error());
    return std::make_shared<const lod::Store>(std::move(*store));
}

render::Image draw(const std::vector<render::PlacedStore>& placed, render::Backend& backend, Executor& executor,
                   const lod::View& view, const render::FrameSettings& settings, FrameCounters* counters) {
    auto state = render::makeFrameState(placed, backend, executor, {});
    const auto complete = render::renderUntilComplete(*state, view, settings);
    if (!complete) fatal(complete.error());
    EXPECT_TRUE(*complete);
    if (counters) *counters = state->counters;
    return std::move(state->image);
}

render::Image renderView(std::shared_ptr<const lod::Store> store, render::Backend& backend, Executor& executor,
                         const lod::View& view, const render::FrameSettings& settings, FrameCounters* counters) {
    return draw({{std::move(store), {}, {}}}, backend, executor, view, settings, counters);
}

std::vector<std::array<int64_t, 3>> leafLattice(const lod::Store& store) {
    std::vector<std::array<int64_t, 3>> all;
    for (uint32_t i = 0; i < store.hierarchy.nodes.size(); ++i) {
        const lod::Node& n = store.hierarchy.nodes[i];
        if (!n.isLeaf()) continue;
        const auto chunk = lod::readChunk(store, i, true);
        if (!chunk) fatal(chunk.error());
        for (size_t k = 0; k < chunk->records.size(); ++k) {
            const auto& r = chunk->records[k];
            const std::array<uint32_t, 3> q{shared::recordX(r), shared::recordY(r), shared::recordZ(r)};
            std::array<int64_t, 3> p{};
            for (size_t a = 0; a < 3; ++a) {
                const int64_t cell = static_cast<int64_t>(n.cell.at(a)) << (store.hierarchy.rootLog2 - n.level);
                p.at(a) = cell + (n.stepShift >= 0 ? (int64_t{q.at(a)} << n.stepShift) +
                                                         (chunk->lowBits.empty() ? 0 : chunk->lowBits[3 * k + a])
                                                   : int64_t{q.at(a)} >> -n.stepShift);
            }
            all.push_back(p);
        }
    }
    std::sort(all.begin(), all.end());
    return all;
}

lod::View fitView(const lod::Store& store, uint32_t width, uint32_t height) {
    const lod::StoreDescription& d = store.description;
    // Its own framing: pictures and figures of the tests do not change with the one of the program.
    scene::Camera camera;
    camera.up = d.up;
    const glm::dvec3 first(d.up.z, d.up.x, d.up.y), second(d.up.y, d.up.z, d.up.x);  // the axes after `up`
    const double azimuth = (d.up.y > 0.9 ? 20 : 235) * 0.017453292519943295, elevation = 25 * 0.017453292519943295;
    const glm::dvec3 direction =
        std::cos(elevation) * (std::cos(azimuth) * first + std::sin(azimuth) * second) + std::sin(elevation) * d.up;
    const double tanV = std::tan(0.5 * camera.fovDegrees * 0.017453292519943295) * 0.92,
                 tanH = tanV * double(width) / height;
    const glm::dvec3 right = glm::normalize(glm::cross(-direction, d.up)), down = glm::cross(-direction, right);
    camera.target = 0.5 * (d.boundsMin + d.boundsMax);
    double distance = 0;
    for (const glm::dvec3& corner : scene::cornersOf(d.boundsMin, d.boundsMax)) {
        const glm::dvec3 p = corner - camera.target;
        const double depth = -glm::dot(p, direction);
        distance = std::max(
            {distance, std::abs(glm::dot(p, right)) / tanH - depth, std::abs(glm::dot(p, down)) / tanV - depth});
    }
    camera.eye = camera.target + direction * (distance > 0 ? distance : 1);
    return scene::makeView(camera, width, height, 1e-5 * glm::length(d.boundsMax - d.boundsMin));
}

std::string dataFile(const std::string& name) {
    const char* folder = std::getenv("STIPPLE_DATA");
    const std::string path = std::string(folder ? folder : "") + "/" + name;
    if (folder && std::filesystem::exists(path)) return path;
    if (std::getenv("STIPPLE_REQUIRE_DATA")) throw std::runtime_error("the data is required, but there is no " + path);
    const std::string line = fmt::format("SKIP {}: set STIPPLE_DATA to the data folder\n", name);
    fmt::print("{}", line);
    if (const char* list = std::getenv("STIPPLE_SKIP_FILE")) std::ofstream(list, std::ios::app) << line;
    return {};
}

std::string slurp(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void spit(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void expectGolden(const render::Image& image, const std::string& name) {
    const std::string path = std::string(STIPPLE_SOURCE_DIR) + "/tests/golden/" + name + ".png";
    if (std::getenv("STIPPLE_RENEW_GOLDENS")) {
        ASSERT_TRUE(image::writeImage(path, image));
        FAIL() << path << " was written: look at it, then commit it";
    }
    const auto golden = image::readImage(path);
    ASSERT_TRUE(golden) << golden.error().line();
    const auto d = reference::compareImages(image, *golden, 8, nullptr);
    ASSERT_TRUE(d);
    EXPECT_LE(d->differingFraction, 0.002);
    EXPECT_GE(d->silhouetteIou, 0.999);
    EXPECT_GT(d->psnr, 40);
}

double drawnPsnr(const render::Image& a, const render::Image& b) {
    double sum = 0, count = 1;
    for (size_t i = 0; i < a.rgba.size(); ++i) {
        if (((a.rgba[i] | b.rgba[i]) >> 24) == 0) continue;
        for (uint32_t shift = 0; shift < 24; shift += 8, ++count) {
            const double d = (double(a.rgba[i] >> shift & 255u) - double(b.rgba[i] >> shift & 255u)) / 255;
            sum += d * d;
        }
    }
    return -10 * std::log10(std::max(sum / count, 1e-12));
}

lod::View viewFromAbove(const glm::dvec3& centre) {
    lod::View view;
    view.eye = centre + glm::dvec3(0, 0, 3);
    view.width = view.height = 400;
    view.focalPixels = 420;
    view.nearPlane = 0.01;
    return view;
}

render::FrameSettings drawnAs(render::Mode mode, double errorPixels, bool isLit) {
    render::FrameSettings settings;
    settings.mode = mode;
    settings.budgets.errorPixels = errorPixels;
    settings.wantDepthAndNormal = true;
    settings.draw.lit = isLit;
    return settings;
}

std::map<std::string, std::unique_ptr<render::Backend>> cpuBackendsAndOracle(Executor& executor) {
    std::map<std::string, std::unique_ptr<render::Backend>> out;
    size_t count = 0;
    const cpu::Kernels* const* all = cpu::availableKernels(count);
    for (size_t k = 0; k < count; ++k) out[all[k]->name] = cpu::makeCpuBackend(executor, all[k]);
    out["fp64"] = reference::makeReferenceBackend(executor);
    return out;
}

}  // namespace stipple::test
