// The discs of leaves against the surface that the points came from: do their outlines agree, and is the surface
// closed? Judged by rays through the triangles and planes themselves, in doubles; nothing here knows how a radius was
// found.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>

#include "engine/reference/decode.h"
#include "tests/support/support.h"

namespace stipple {
namespace {

using Triangle = std::array<glm::dvec3, 3>;

std::vector<reference::Disc> leafDiscs(const lod::Store& store) {
    std::vector<reference::Disc> discs;
    const lod::Hierarchy& h = store.hierarchy;
    for (uint32_t n = 0; n < h.nodes.size(); ++n) {
        if (!h.nodes[n].isLeaf()) continue;
        const auto chunk = lod::readChunk(store, n);
        if (!chunk) continue;
        for (const shared::PointRecord& r : chunk->records) discs.push_back(reference::decodeDisc(h, h.nodes[n], r));
    }
    return discs;
}

// ---- surfaces ----

/// A grid of `across` by `along` quadrilaterals of a closed or open patch.
std::vector<Triangle> patch(int across, int along, const std::function<glm::dvec3(double, double)>& at) {
    std::vector<Triangle> all;
    for (int i = 0; i < across; ++i)
        for (int k = 0; k < along; ++k) {
            const auto corner = [&](int di, int dk) { return at(double(i + di) / across, double(k + dk) / along); };
            all.push_back({corner(0, 0), corner(1, 0), corner(1, 1)});
            all.push_back({corner(0, 0), corner(1, 1), corner(0, 1)});
        }
    return all;
}

std::vector<Triangle> torus() {
    return patch(160, 80, [](double u, double v) {
        const double a = 2 * M_PI * u, b = 2 * M_PI * v, r = 1 + 0.35 * std::cos(b);
        return glm::dvec3(r * std::cos(a), r * std::sin(a), 0.35 * std::sin(b));
    });
}
/// A sheet with folds of a right angle.
std::vector<Triangle> folds() {
    return patch(12, 1, [](double u, double v) {
        const double x = 6 * u, along = x - 2 * std::floor(x / 2);
        return glm::dvec3(x, 6 * v, along < 1 ? along : 2 - along);
    });
}
std::vector<Triangle> box() {
    std::vector<Triangle> all;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0})
            for (const Triangle& t : patch(1, 1, [&](double u, double v) {
                     glm::dvec3 p(0);
                     p[axis] = side;
                     p[(axis + 1) % 3] = 2 * u - 1;
                     p[(axis + 2) % 3] = 2 * v - 1;
                     return p * glm::dvec3(1, 0.6, 0.8);
                 }))
                all.push_back(t);
    return all;
}
std::vector<Triangle> bunny(const std::string& path) {
    std::ifstream in(path);
    std::string line;
    size_t vertices = 0, faces = 0;
    while (std::getline(in, line) && line.find("end_header") != 0) {
        std::istringstream words(line);
        std::string element, what;
        size_t count = 0;
        words >> element >> what >> count;
        if (element == "element") (what == "vertex" ? vertices : faces) = count;
    }
    std::vector<glm::dvec3> at(vertices);
    for (glm::dvec3& p : at) {
        double confidence = 0, intensity = 0;
        in >> p.x >> p.y >> p.z >> confidence >> intensity;
    }
    std::vector<Triangle> all(faces);
    for (Triangle& t : all) {
        size_t corners = 0;
        in >> corners;
        for (glm::dvec3& p : t) {
            size_t index = 0;
            in >> index;
            p = at.at(index);
        }
    }
    return all;
}

glm::dvec3 areaVector(const Triangle& t) { return 0.5 * glm::cross(t[1] - t[0], t[2] - t[0]); }
double areaOf(const std::vector<Triangle>& surface) {
    double sum = 0;
    for (const Triangle& t : surface) sum += glm::length(areaVector(t));
    return sum;
}

struct Sample {
    glm::dvec3 place, normal;
};
/// `count` places spread evenly by chance.
std::vector<Sample> sample(const std::vector<Triangle>& surface, size_t count, uint64_t seed) {
    std::vector<double> upTo;
    double sum = 0;
    for (const Triangle& t : surface) upTo.push_back(sum += glm::length(areaVector(t)));
    Rng rng(seed);
    std::vector<Sample> all;
    for (size_t k = 0; k < count; ++k) {
        const auto found = std::lower_bound(upTo.begin(), upTo.end(), rng.uniform() * sum);
        const Triangle& t = surface[std::min(static_cast<size_t>(found - upTo.begin()), surface.size() - 1)];
        double u = rng.uniform(), v = rng.uniform();
        if (u + v > 1) {
            u = 1 - u;
            v = 1 - v;
        }
        all.push_back({t[0] + u * (t[1] - t[0]) + v * (t[2] - t[0]), glm::normalize(areaVector(t))});
    }
    return all;
}
/// The same without instance groups: places that come too near to an earlier one are left out.
std::vector<Sample> sampleEvenly(const std::vector<Triangle>& surface, size_t count, uint64_t seed) {
    const double least = 0.8 * std::sqrt(areaOf(surface) / static_cast<double>(count));
    std::map<std::array<int64_t, 3>, std::vector<glm::dvec3>> cells;
    std::vector<Sample> kept;
    for (const Sample& s : sample(surface, 30 * count, seed)) {
        const auto cell = [&](int a) { return static_cast<int64_t>(std::floor(s.place[a] / least)); };
        bool isFree = true;
        for (int64_t k = 0; k < 27 && isFree; ++k) {
            const auto found = cells.find({cell(0) + k % 3 - 1, cell(1) + k / 3 % 3 - 1, cell(2) + k / 9 - 1});
            if (found == cells.end()) continue;
            for (const glm::dvec3& p : found->second) isFree = isFree && glm::length(p - s.place) >= least;
        }
        if (!isFree) continue;
        cells[{cell(0), cell(1), cell(2)}].push_back(s.place);
        kept.push_back(s);
    }
    return kept;
}

// ---- outlines ----

/// Parallel rays along z of a turned world, one for each pixel.
struct Raster {
    glm::dmat3 turn{1};
    glm::dvec2 corner{0};
    double pixel = 1;
    int64_t width = 0, height = 0;
    std::vector<uint8_t> covered;
    /// Calls isHit(x, y) for the rays within a box of the turned world.
    template <typename F>
    void mark(glm::dvec2 lo, glm::dvec2 hi, const F& isHit) {
        const auto first = [&](double v, double c) { return static_cast<int64_t>(std::ceil((v - c) / pixel - 0.5)); };
        for (int64_t y = std::max<int64_t>(first(lo.y, corner.y), 0); y < height; ++y) {
            const double py = corner.y + (static_cast<double>(y) + 0.5) * pixel;
            if (py > hi.y) break;
            for (int64_t x = std::max<int64_t>(first(lo.x, corner.x), 0); x < width; ++x) {
                const double px = corner.x + (static_cast<double>(x) + 0.5) * pixel;
                if (px > hi.x) break;
                uint8_t& at = covered[static_cast<size_t>(y * width + x)];
                if (at == 0 && isHit(px, py)) at = 1;
            }
        }
    }
};

void markTriangle(Raster& raster, const Triangle& t) {
    std::array<glm::dvec3, 3> p;
    for (size_t k = 0; k < 3; ++k) p.at(k) = raster.turn * t.at(k);
    const glm::dvec2 a(p[0]), b(p[1]), c(p[2]);
    raster.mark(glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c)), [&](double x, double y) {
        const auto side = [&](const glm::dvec2& from, const glm::dvec2& to) {
            return (to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x);
        };
        const double s0 = side(a, b), s1 = side(b, c), s2 = side(c, a);
        return (s0 >= 0 && s1 >= 0 && s2 >= 0) || (s0 <= 0 && s1 <= 0 && s2 <= 0);
    });
}
void markDisc(Raster& raster, const reference::Disc& d) {
    const glm::dvec3 c = raster.turn * d.position;
    // Without a normal it faces the viewer.
    const glm::dvec3 n = d.normal == glm::dvec3(0) ? glm::dvec3(0, 0, 1) : raster.turn * d.normal;
    const glm::dvec2 at(c), reach(d.radius);
    if (std::abs(n.z) < 1e-9) return;
    raster.mark(at - reach, at + reach, [&](double x, double y) {
        const double dx = x - c.x, dy = y - c.y, dz = -(n.x * dx + n.y * dy) / n.z;
        return dx * dx + dy * dy + dz * dz <= d.radius * d.radius;
    });
}

struct Outline {
    double iou = 0;
    size_t missed = 0;  ///< pixels more than one inside of the surface's outline that no disc covers
};
/// Over several directions. `pixel`: world units.
Outline compareOutlines(const std::vector<Triangle>& surface, const std::vector<reference::Disc>& discs, double pixel) {
    Outline all;
    const std::vector<glm::dvec3> directions{{0.1, 0.2, 1}, {1, 0.3, 0.2}, {0.5, -1, 0.4}, {-0.7, 0.6, 0.7}};
    for (const glm::dvec3& towards : directions) {
        const glm::dvec3 z = glm::normalize(towards), x = glm::normalize(glm::cross(glm::dvec3(0, 1, 0.01), z));
        Raster truth;
        truth.turn = glm::transpose(glm::dmat3(x, glm::cross(z, x), z));
        truth.pixel = pixel;
        glm::dvec2 lo(1e300), hi(-1e300);
        for (const Triangle& t : surface)
            for (const glm::dvec3& p : t) {
                lo = glm::min(lo, glm::dvec2(truth.turn * p));
                hi = glm::max(hi, glm::dvec2(truth.turn * p));
            }
        truth.corner = lo - 0.2 * (hi - lo);
        truth.width = static_cast<int64_t>(1.4 * (hi.x - lo.x) / pixel);
        truth.height = static_cast<int64_t>(1.4 * (hi.y - lo.y) / pixel);
        truth.covered.assign(static_cast<size_t>(truth.width * truth.height), 0);
        Raster drawn = truth;
        for (const Triangle& t : surface) markTriangle(truth, t);
        for (const reference::Disc& d : discs) markDisc(drawn, d);
        double both = 0, either = 0;
        for (size_t k = 0; k < truth.covered.size(); ++k) {
            both += truth.covered[k] & drawn.covered[k];
            either += truth.covered[k] | drawn.covered[k];
        }
        for (int64_t py = 1; py + 1 < truth.height; ++py)
            for (int64_t px = 1; px + 1 < truth.width; ++px) {
                const auto k = static_cast<size_t>(py * truth.width + px);
                const auto w = static_cast<size_t>(truth.width);
                all.missed += drawn.covered[k] == 0 && truth.covered[k] && truth.covered[k - 1] &&
                              truth.covered[k + 1] && truth.covered[k - w] && truth.covered[k + w];
            }
        all.iou += both / either / static_cast<double>(directions.size());
    }
    return all;
}

/// Of places on the surface, looked at from straight above: the share that no disc near by covers.
double openShare(const std::vector<Sample>& places, const std::vector<reference::Disc>& discs, double spacing) {
    const double cell = 2 * spacing;
    std::map<std::array<int64_t, 3>, std::vector<size_t>> cells;
    const auto cellOf = [&](const glm::dvec3& p) {
        return std::array<int64_t, 3>{static_cast<int64_t>(std::floor(p.x / cell)),
                                      static_cast<int64_t>(std::floor(p.y / cell)),
                                      static_cast<int64_t>(std::floor(p.z / cell))};
    };
    double widest = 0;
    for (size_t k = 0; k < discs.size(); ++k) {
        cells[cellOf(discs[k].position)].push_back(k);
        widest = std::max(widest, discs[k].radius);
    }
    const auto reach = static_cast<int64_t>(std::ceil(widest / cell));
    size_t open = 0;
    for (const Sample& s : places) {
        const auto at = cellOf(s.place);
        bool isCovered = false;
        for (int64_t dz = -reach; dz <= reach && !isCovered; ++dz)
            for (int64_t dy = -reach; dy <= reach && !isCovered; ++dy)
                for (int64_t dx = -reach; dx <= reach && !isCovered; ++dx) {
                    const auto found = cells.find({at[0] + dx, at[1] + dy, at[2] + dz});
                    if (found == cells.end()) continue;
                    for (const size_t k : found->second) {
                        const reference::Disc& d = discs[k];
                        const glm::dvec3 n = d.normal == glm::dvec3(0) ? s.normal : d.normal;
                        const double slope = glm::dot(n, s.normal);
                        if (std::abs(slope) < 0.05) continue;
                        const double height = glm::dot(n, d.position - s.place) / slope;
                        const glm::dvec3 hit = s.place + height * s.normal - d.position;
                        if (std::abs(height) > 2 * spacing || glm::dot(hit, hit) > d.radius * d.radius) continue;
                        isCovered = true;
                        break;
                    }
                }
        open += !isCovered;
    }
    return static_cast<double>(open) / static_cast<double>(places.size());
}

std::vector<reference::Disc> discsOf(const std::vector<Sample>& samples, bool withNormals) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    std::vector<test::TestPoint> points;
    for (const Sample& s : samples) points.push_back({s.place, glm::vec3(s.normal)});
    test::writePly(folder / "a.ply", points, withNormals);
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor);
    const auto store = lod::openStore(folder / "a.stipple");
    EXPECT_TRUE(store);
    return leafDiscs(*store);
}

TEST(LeafDiscs, OutlinesAgreeWithTheSurface) {
    struct Case {
        double apart, estimated, given;  ///< pixels between points; least overlap (IoU) with normals of either kind
        double openAtEdges = 0.004;      ///< share of the surface that may be open, normals given
        size_t missed = 20;              ///< the same, pixels
    };
    struct Shape {
        std::string name;
        std::vector<Triangle> surface;
        std::vector<Case> cases;
    };
    // (Discs of a wall with its exact normal do not reach round its edges.)
    std::vector<Shape> shapes{{"torus", torus(), {{4, 0.985, 0.985}, {12, 0.94, 0.94}}},
                              {"box", box(), {{4, 0.965, 0.955, 0.008}, {12, 0.91, 0.885, 0.022}}},
                              {"folds", folds(), {{4, 0.94, 0.935, 0.004, 60}, {12, 0.86, 0.85, 0.014, 280}}}};
    if (const std::string path = test::dataFile("01_meshes/bunny/bun_zipper.ply"); !path.empty())
        shapes.push_back({"bunny", bunny(path), {{4, 0.97, 0.97}, {12, 0.89, 0.885}}});
    for (const auto& [name, surface, cases] : shapes)
        for (const Case& c : cases)
            for (const bool isGiven : {false, true}) {
                const double area = areaOf(surface), pixel = std::sqrt(area) / 300, wanted = c.apart * pixel;
                const auto samples = sampleEvenly(surface, static_cast<size_t>(area / wanted / wanted), 5);
                const double spacing = std::sqrt(area / static_cast<double>(samples.size()));
                std::vector<reference::Disc> discs = discsOf(samples, isGiven);
                const Outline outline = compareOutlines(surface, discs, pixel);
                const double open = openShare(sample(surface, 20000, 77), discs, spacing);
                std::printf("%s, %.0f px, normals %s: IoU %.4f, %zu pixels inside missed, %.3f %% open\n", name.c_str(),
                            c.apart, isGiven ? "given" : "estimated", outline.iou, outline.missed, 100 * open);
                EXPECT_GE(outline.iou, isGiven ? c.given : c.estimated) << name << " " << c.apart;
                EXPECT_LE(open, isGiven ? c.openAtEdges : 0.004) << name << " " << c.apart;
                if (isGiven) EXPECT_LE(outline.missed, c.missed) << name << " " << c.apart;
                if (c.apart != 4) continue;
                // Discs of 1.44 spacings, whatever is near.
                for (reference::Disc& d : discs) d.radius = 1.44 * spacing;
                EXPECT_LT(compareOutlines(surface, discs, pixel).iou, outline.iou - 0.008) << name;
            }
}

// ---- closed surfaces ----

TEST(LeafDiscs, CloseTheSurfaceHoweverThePointsAreSpread) {
    const double size = 100;  // a square of that many spacings, bent a little
    const auto bent = [&](double x, double y) { return glm::dvec3(x, y, 8 * std::sin(x / 25) * std::cos(y / 30)); };
    const std::vector<Triangle> surface =
        patch(100, 100, [&](double u, double v) { return bent(5 + (size - 10) * u, 5 + (size - 10) * v); });
    struct Spread {
        std::string name;
        double most;  ///< share of the surface that may be open
        std::vector<glm::dvec3> places;
    };
    Rng rng(21);
    std::vector<Spread> spreads(5);
    spreads[0] = {"even", 1e-4, {}};
    for (int k = 0; k < 10000; ++k)
        spreads[0].places.push_back(
            bent(k % 100 + rng.uniform(0.2, 0.8), k / 100 + rng.uniform(0.2, 0.8)));  // NOLINT: a grid's row
    spreads[1] = {"by chance", 1.5e-3, {}};
    for (int k = 0; k < 10000; ++k) spreads[1].places.push_back(bent(rng.uniform(0, size), rng.uniform(0, size)));
    spreads[2] = {"thirteen copies of each", 1e-4, {}};
    for (const glm::dvec3& p : spreads[0].places)
        for (int copy = 0; copy < 13; ++copy) spreads[2].places.push_back(p);
    spreads[3] = {"groups of twenty", 5e-3, {}};
    for (const glm::dvec3& p : spreads[0].places)
        for (int k = 0; k < 20; ++k)
            spreads[3].places.push_back(bent(p.x + 0.02 * rng.uniform(-1, 1), p.y + 0.02 * rng.uniform(-1, 1)));
    spreads[4] = {"lines 1:20", 1e-3, {}};
    for (int line = 0; line < 45; ++line)
        for (int k = 0; k < 900; ++k)
            spreads[4].places.push_back(bent(k / 9.0 + 0.03 * rng.uniform(-1, 1), line * 20 / 9.0));
    for (const Spread& s : spreads)
        for (const bool isFine : {false, true}) {
            const test::TempFolder folder;
            const auto executor = makeTbbExecutor(2);
            std::vector<test::TestPoint> points;
            for (const glm::dvec3& p : s.places) points.push_back({p});
            test::writePly(folder / "a.ply", points, false);
            lod::BuildSettings settings;
            settings.fineNormals = isFine;
            test::build({folder / "a.ply"}, folder / "a.stipple", *executor, settings);
            const auto store = lod::openStore(folder / "a.stipple");
            ASSERT_TRUE(store);
            const std::vector<reference::Disc> discs = leafDiscs(*store);
            const double open = openShare(sample(surface, 40000, 78), discs, 1);
            double mean = 0, widest = 0;
            for (const auto& d : discs) {
                mean += d.radius / static_cast<double>(discs.size());
                widest = std::max(widest, d.radius);
            }
            std::printf("%s, %s: %.4f %% open, radius %.2f, at most %.2f\n", s.name.c_str(), isFine ? "fine" : "auto",
                        100 * open, mean, widest);
            EXPECT_LE(open, s.most) << s.name;
        }
}

// ---- neighbourhoods that lie along lines ----

struct Directions {
    size_t points = 0, without = 0, off = 0;  ///< off: by more than 45 degrees
    double leastRadius = 1e300;
};
/// `normalAt`: the true one.
Directions directionsOf(const std::vector<test::TestPoint>& points, bool isFine,
                        const std::function<glm::dvec3(const glm::dvec3&)>& normalAt) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "a.ply", points, false);
    lod::BuildSettings settings;
    settings.fineNormals = isFine;
    test::build({folder / "a.ply"}, folder / "a.stipple", *executor, settings);
    const auto store = lod::openStore(folder / "a.stipple");
    EXPECT_TRUE(store);
    Directions found;
    for (const reference::Disc& d : leafDiscs(*store)) {
        ++found.points;
        found.without += (d.flags & shared::kFlagNoNormal) != 0;
        found.off += (d.flags & shared::kFlagNoNormal) == 0 &&
                     std::abs(glm::dot(d.normal, normalAt(d.position))) < std::sqrt(0.5);
        found.leastRadius = std::min(found.leastRadius, d.radius);
    }
    return found;
}

TEST(LeafDiscs, PointsOfALineHaveNoNormal) {
    const std::vector<std::pair<glm::dvec3, glm::dvec3>> lines{
        {{0, 0, 0}, {1, 2, 3}}, {{4e5, 5.2e6, 120}, {0.3, -1, 0.01}}, {{0, 0, 0}, {1, 0, 0}}};
    for (const auto& [from, towards] : lines)
        for (const bool isEven : {true, false}) {
            constexpr int kPoints = 20000;
            Rng rng(3);
            std::vector<test::TestPoint> points;
            for (int k = 0; k < kPoints; ++k)
                points.push_back({from + glm::normalize(towards) * (isEven ? 0.005 * k : rng.uniform(0, 100))});
            for (const bool isFine : {false, true}) {
                const Directions d = directionsOf(points, isFine, [](const glm::dvec3& p) { return p; });
                EXPECT_EQ(d.points, points.size());
                EXPECT_EQ(d.without, d.points) << (isFine ? "fine" : "auto") << " along " << towards.x;
                if (isEven) EXPECT_GE(d.leastRadius, 0.5 * 0.005) << "each meets the next one";
            }
        }
}

TEST(LeafDiscs, NormalsAcrossScanLinesAreThoseOfTheSurface) {
    for (const double noise : {0.05, 1.0})  // of the step along a line; 1: 5 % of the distance between lines
        for (const bool isBent : {false, true})
            for (const bool isFine : {false, true}) {
                Rng rng(8);
                std::vector<test::TestPoint> points;
                for (int line = 0; line < 20; ++line)
                    for (int k = 0; k < 400; ++k) {
                        glm::dvec3 p(k + noise * rng.normal(), 20 * line + noise * rng.normal(), noise * rng.normal());
                        // Around a cylinder, each line a ring of it, 25 lines' distances across.
                        if (isBent) p = {(250 + p.z) * std::cos(p.x / 250), p.y, (250 + p.z) * std::sin(p.x / 250)};
                        points.push_back({p});
                    }
                const Directions d = directionsOf(points, isFine, [&](const glm::dvec3& p) {
                    return isBent ? glm::normalize(glm::dvec3(p.x, 0, p.z)) : glm::dvec3(0, 0, 1);
                });
                std::printf("scan lines 1:20, noise %.2f steps, %s, %s: %zu of %zu off, %zu without\n", noise,
                            isBent ? "bent" : "flat", isFine ? "fine" : "auto", d.off, d.points, d.without);
                EXPECT_EQ(d.points, 8000u);
                EXPECT_LE(d.off, d.points / 100);
                EXPECT_LE(d.without, d.points / 50);
            }
}

TEST(LeafDiscs, AGivenRadiusOfAnySizeHarmsNoOther) {
    Rng rng(4);
    std::vector<test::TestPoint> points;
    for (int k = 0; k < 5000; ++k) points.push_back({{rng.uniform(), rng.uniform(), 0}, {0, 0, 1}, 0xc0c0c0, 0.02f});
    points[17].radius = 1e30f;
    points[18].radius = 3e38f;
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    test::writePly(folder / "a.ply", points, true, true);
    const auto store = test::buildAndOpen(folder / "a.ply", folder / "a.stipple", *executor);
    size_t wide = 0;
    for (const reference::Disc& d : leafDiscs(*store)) {
        ASSERT_TRUE(std::isfinite(d.radius));
        ASSERT_LE(d.radius, 2.0) << "no more than the cube around all points";
        wide += d.radius > 0.025;
    }
    EXPECT_EQ(wide, 2u);
    for (const lod::Node& n : store->hierarchy.nodes) EXPECT_LT(n.radius * store->hierarchy.unit, 4.0);
}

/// Radii are shares of cells, and cells are as small as what points span.
TEST(LeafDiscs, GivenRadiiOfFewPointsAreThoseOfTheFileHoweverNearTheyLie) {
    const test::TempFolder folder;
    const auto executor = makeTbbExecutor(2);
    int number = 0;
    for (const size_t count : {1, 2, 8})
        for (const double apart : {0.0, 1e-4})
            for (const float radius : {1e-9f, 0.01f, 0.5f, 7.0f}) {
                if (apart > 0 && radius < 1e-6f) continue;  // less than a step of what they span
                std::vector<test::TestPoint> points(count);
                for (size_t i = 0; i < count; ++i) {
                    points[i].position = {3 + apart * static_cast<double>(i) / 40, 4, 5};
                    points[i].normal = {0, 0, 1};
                    points[i].radius = radius;
                }
                const std::string name = folder / std::to_string(number++);
                test::writePly(name + ".ply", points, true, true);
                const auto store = test::buildAndOpen(name + ".ply", name + ".stipple", *executor);
                const std::vector<reference::Disc> discs = leafDiscs(*store);
                ASSERT_EQ(discs.size(), count);
                for (size_t i = 0; i < count; ++i) {
                    EXPECT_GE(discs[i].radius, radius * (1 - 1e-6)) << count << " " << apart;
                    EXPECT_LE(discs[i].radius, radius * std::exp2(1.0 / 16) * (1 + 1e-6)) << count << " " << apart;
                    // Drawn to half a step, of 2^-16 of a cell that is at most four times as wide as a disc.
                    EXPECT_NEAR(discs[i].position.x, points[i].position.x, 0x1p-15 * radius + 1e-9 * apart);
                }
            }
}

}  // namespace
}  // namespace stipple
