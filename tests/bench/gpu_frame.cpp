// What a frame of many records takes on a device, pass by pass, with far more of them resident than any file at hand
// has: tiles of hilly ground (shaders/shared/ground.h), a node each, whose chunks lie one by one in the device's
// memory. A compute shader makes them there, and some records of each are read back and compared with the host's; with
// --filled host all come from the host. Of each node the first records are drawn, as a cut draws them. With --replaced
// so many tiles (1 MiB each) go and come again before each frame, from the host. Prints one line of JSON a mode.
//
//   stipple_gpu_frame [--resident 10000000] [--drawn 10000000] [--size 1920x1080] [--modes pullpush,splat]
//                     [--frames 50] [--replaced 0] [--filled device|host] [--device NAME] [--picture PREFIX]
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "engine/gpu/gpu_backend.h"
#include "engine/render/frame_passes.h"
#include "shaders/shared/surface.h"
#include "tests/bench/ground_fill.h"

namespace stipple {
namespace {

using Clock = std::chrono::steady_clock;
constexpr uint32_t kOfTile = 1u << 16;  // records

template <typename T>
T valueOf(Result<T> result) {
    if (!result) throw std::runtime_error(result.error().line());
    if constexpr (!std::is_void_v<T>) return std::move(*result);
}

struct Options {
    uint64_t resident = 10'000'000, drawn = 10'000'000;
    uint32_t width = 1920, height = 1080;
    std::vector<std::string> modes{"pullpush"};
    int frames = 50;
    uint32_t replaced = 0;  ///< tiles before each frame
    bool fromHost = false;
    std::string device, picture;
};

Options optionsOf(int argc, char** argv) {
    Options o;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string name = argv[i], value = argv[i + 1];
        if (name == "--resident") {
            o.resident = std::stoull(value);
        } else if (name == "--drawn") {
            o.drawn = std::stoull(value);
        } else if (name == "--size") {
            o.width = static_cast<uint32_t>(std::stoul(value));
            o.height = static_cast<uint32_t>(std::stoul(value.substr(value.find('x') + 1)));
        } else if (name == "--modes") {
            o.modes.clear();
            std::istringstream all(value);
            for (std::string mode; std::getline(all, mode, ',');) o.modes.push_back(mode);
        } else if (name == "--frames") {
            o.frames = std::stoi(value);
        } else if (name == "--replaced") {
            o.replaced = static_cast<uint32_t>(std::stoul(value));
        } else if (name == "--filled" && (value == "host" || value == "device")) {
            o.fromHost = value == "host";
        } else if (name == "--device") {
            o.device = value;
        } else if (name == "--picture") {
            o.picture = value;
        } else {
            throw std::runtime_error("unknown option " + name);
        }
    }
    if (argc % 2 == 0) throw std::runtime_error("an option without a value");
    return o;
}

/// Of radii. `count`: how many records of a tile are drawn.
uint32_t radiusCodeOf(uint32_t count) {
    return static_cast<uint32_t>(std::clamp(255 + 16 * std::log2(0.8 / std::sqrt(count)), 0.0, 255.0));
}
lod::Chunk makeTile(uint32_t number, uint32_t radiusCode) {
    lod::Chunk chunk;
    chunk.records.resize(kOfTile);
    for (uint32_t i = 0; i < kOfTile; ++i) chunk.records[i] = shared::groundRecord(number, i, radiusCode);
    return chunk;
}

/// All tiles into the device's memory, filled there; of some records of each: that they are what they should be.
uint64_t fillOnDevice(render::Backend& backend, uint32_t tiles, uint32_t radiusCode) {
    constexpr uint32_t kSamples = 4;  // of a tile
    std::vector<gpu::GroundTile> ground;
    const gpu::Device* device = nullptr;
    for (uint32_t t = 0; t < tiles; ++t) {
        const auto place = valueOf(gpu::reserve(backend, {0, t}, uint64_t{kOfTile} * sizeof(shared::PointRecord)));
        ground.push_back({t, place.address});
        device = place.device;
    }
    const auto fill = valueOf(gpu::GroundFill::create(*device));
    valueOf(fill->fill(ground, kOfTile, radiusCode));
    if (const uint64_t differ = valueOf(fill->differing(ground, kOfTile, radiusCode, kSamples)); differ > 0)
        throw std::runtime_error(fmt::format("{} of {} records that were looked at are not what the host makes", differ,
                                             uint64_t{kSamples} * tiles));
    return uint64_t{kSamples} * tiles;
}

lod::View viewOf(const Options& o, double side) {
    lod::View view;
    view.width = o.width;
    view.height = o.height;
    view.focalPixels = 1.2 * o.height;
    view.forward = glm::normalize(glm::dvec3(0, 0.8, -0.6));
    view.right = glm::dvec3(1, 0, 0);
    view.down = glm::cross(view.forward, view.right);
    view.eye = glm::dvec3(0.5 * side, 0.45 * side, 0) - 0.75 * side * view.forward;
    view.nearPlane = 1e-3;
    return view;
}

/// All tiles, in an order that has nothing to do with where they are.
void addTiles(uint32_t tiles, uint32_t side, uint32_t count, const lod::View& view, render::DrawList& list) {
    const glm::dmat3 cameraFromWorld = glm::transpose(glm::dmat3(view.right, view.down, view.forward));
    std::vector<uint32_t> order(tiles);
    for (uint32_t t = 0; t < tiles; ++t) order[t] = t;
    std::mt19937 rng(3);
    std::shuffle(order.begin(), order.end(), rng);
    render::DrawBatch& batch = list.of(lod::Kind::points);
    for (const uint32_t t : order) {
        shared::DrawNode node{};
        node.axisX = glm::vec3(cameraFromWorld[0] / 65536.0);
        node.axisY = glm::vec3(cameraFromWorld[1] / 65536.0);
        node.axisZ = glm::vec3(cameraFromWorld[2] / 65536.0);
        node.base = glm::vec3(cameraFromWorld * (glm::dvec3(t % side, t / side, 0) - view.eye));
        node.edge = 1;
        node.errorCode = 255;
        node.count = count;
        node.material = shared::kPlainPoint;
        node.octantMask = shared::kNodeTurned;
        const auto index = static_cast<uint32_t>(batch.nodes.size());
        for (uint32_t first = 0; first < count; first += shared::kRecordsPerBlock)
            batch.blocks.push_back({index, first});
        batch.nodes.push_back(node);
        batch.keys.push_back({0, t});
    }
    const auto blocks = static_cast<uint32_t>(batch.blocks.size());
    for (uint32_t k = shared::kKindPoints + 1; k < shared::kKindNothing; ++k) list.frame.firstBlock.of[k] = blocks;
}

double middle(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}
double since(Clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

/// A few alone, whose passes are told apart; then as many as may be in flight. `replace` comes before each.
nlohmann::json measure(render::Backend& backend, render::RenderRequest request, int frames,
                       const std::function<void()>& replace) {
    std::map<std::string, std::vector<double>> passes;
    std::vector<double> alone, device;
    // Buffers and pipelines are made, and clocks that rest are raised.
    constexpr double kWarmUp = 500;  // ms
    for (const Clock::time_point warm = Clock::now(); since(warm) < kWarmUp;)
        valueOf(backend.finish(valueOf(backend.submit(request))));
    for (int f = 0; f < frames; ++f) {
        const Clock::time_point begin = Clock::now();
        replace();
        valueOf(backend.finish(valueOf(backend.submit(request))));
        alone.push_back(since(begin));
        double sum = 0;
        for (const render::PassTime& t : backend.passTimes()) {
            passes[t.name].push_back(t.ms);
            sum += t.isBeside ? 0 : t.ms;
        }
        device.push_back(sum);
    }
    const Clock::time_point begin = Clock::now();
    render::Ticket last;
    for (int f = 0; f < frames; ++f) {
        replace();
        last = valueOf(backend.submit(request));
    }
    valueOf(backend.finish(last));
    nlohmann::json result;
    result["frames"] = frames;
    result["in_flight_ms"] = since(begin) / frames;
    result["alone_ms"] = middle(alone);
    result["passes_ms"] = middle(device);
    for (const auto& [name, times] : passes) result["passes"][name] = middle(times);
    return result;
}

int run(int argc, char** argv) {
    const Options o = optionsOf(argc, argv);
    const auto tiles = static_cast<uint32_t>((o.resident + kOfTile - 1) / kOfTile);
    const auto side = static_cast<uint32_t>(std::ceil(std::sqrt(tiles)));
    const auto count = static_cast<uint32_t>(std::clamp<uint64_t>(o.drawn / tiles, 1, kOfTile));
    const auto backend = valueOf(gpu::makeGpuBackend({o.device, false, {}}));

    render::RenderRequest request;
    render::DrawList list;
    request.draws = &list;
    const lod::View view = viewOf(o, side);
    render::DrawSettings settings;
    settings.lit = true;
    const Clock::time_point begin = Clock::now();
    const uint32_t radiusCode = radiusCodeOf(count);
    const uint64_t compared = o.fromHost ? 0 : fillOnDevice(*backend, tiles, radiusCode);
    constexpr uint32_t kAtOnce = 1024;
    for (uint32_t t = 0; o.fromHost && t < tiles; ++t) {
        valueOf(backend->upload({0, t}, makeTile(t, radiusCode)));
        if (t % kAtOnce != kAtOnce - 1 && t + 1 != tiles) continue;
        lod::View small = view;  // a frame of nothing takes them in
        small.width = small.height = 16;
        render::makeDrawList({}, {}, {}, small, settings, list);
        request.passes = render::passesOf(render::Mode::points, render::contentOf(list), list.effects);
        valueOf(backend->finish(valueOf(backend->submit(request))));
    }
    const double uploaded = since(begin);

    uint32_t next = 0;
    const lod::Chunk replacement = makeTile(0, radiusCode);
    const auto replace = [&] {
        for (uint32_t i = 0; i < o.replaced; ++i, next = (next + 1) % tiles) {
            backend->evict({0, next});
            valueOf(backend->upload({0, next}, lod::Chunk(replacement)));
        }
    };
    for (const std::string& name : o.modes) {
        const render::Reconstruction* const mode = render::reconstructionNamed(name);
        if (mode == nullptr) throw std::runtime_error("no mode " + name);
        render::makeDrawList({}, {}, {}, view, settings, list);
        addTiles(tiles, side, count, view, list);
        request.mode = mode->mode;
        request.passes = render::passesOf(mode->mode, render::contentOf(list), list.effects);
        request.staysOnDevice = true;
        nlohmann::json line = measure(*backend, request, o.frames, replace);
        const double drawn = static_cast<double>(tiles) * count;
        line["device"] = backend->device();
        line["mode"] = name;
        line["size"] = fmt::format("{}x{}", o.width, o.height);
        line["resident"] = uint64_t{tiles} * kOfTile;
        line["drawn"] = drawn;
        line["filled"] = o.fromHost ? "host" : "device";
        line["fill_ms"] = uploaded;
        line["records_compared"] = compared;
        line["replaced"] = o.replaced;
        if (line["passes"].contains("project"))
            line["project_gb_per_s"] =
                1e-6 * drawn * sizeof(shared::PointRecord) / line["passes"]["project"].get<double>();
        fmt::print("{}\n", line.dump());
        std::fflush(stdout);
        if (o.picture.empty()) continue;
        request.staysOnDevice = false;
        render::Image image;
        valueOf(backend->render(request, image));
        std::ofstream file(o.picture + name + ".ppm", std::ios::binary);
        file << fmt::format("P6 {} {} 255\n", image.width, image.height);
        for (const uint32_t pixel : image.rgba)
            for (const uint32_t shift : {0u, 8u, 16u}) file.put(static_cast<char>(pixel >> shift & 255u));
    }
    return 0;
}

}  // namespace
}  // namespace stipple

int main(int argc, char** argv) {
    try {
        return stipple::run(argc, argv);
    } catch (const std::exception& e) {
        fmt::print(stderr, "stipple_gpu_frame: {}\n", e.what());
        return 1;
    }
}
