// What the tests share: small clouds, builds of them, temporary folders, real data.
#pragma once

#include <array>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/executor.h"
#include "engine/base/rng.h"
#include "engine/render/frame.h"
#include "lod/builder/build.h"
#include "lod/store/store.h"

namespace stipple::test {

/// A folder that is removed with all it holds at the end of the test.
class TempFolder {
  public:
    TempFolder();
    ~TempFolder();
    TempFolder(const TempFolder&) = delete;
    TempFolder& operator=(const TempFolder&) = delete;
    std::string operator/(const std::string& name) const { return path_ + "/" + name; }
    const std::string& path() const { return path_; }

  private:
    std::string path_;
};

struct TestPoint {
    glm::dvec3 position{0};
    glm::vec3 normal{0};
    uint32_t colour = 0xc0c0c0;
    float radius = 0;
};

/// Points on a bumpy sphere of radius 1 around `centre`, with outward normals and a smooth colour.
std::vector<TestPoint> bumpySphere(size_t count, uint64_t seed, const glm::dvec3& centre = glm::dvec3(0));
/// Binary PLY with double coordinates, normals, colours and radii.
void writePly(const std::string& path, const std::vector<TestPoint>& points, bool withNormals = true,
              bool withRadii = false);
/// LAS 1.2, point format 2, from integer coordinates.
void writeLas(const std::string& path, const std::vector<glm::ivec3>& points, double scale, const glm::dvec3& offset);

lod::BuildReport build(const std::vector<std::string>& inputs, const std::string& output, Executor& executor,
                       const lod::BuildSettings& settings = {});
/// Builds and opens; leafRecords small, so that few points make a deep tree.
std::shared_ptr<const lod::Store> buildAndOpen(const std::string& input, const std::string& output, Executor& executor,
                                               uint32_t leafRecords = 512);

/// Lattice coordinates of all leaf records of a store, low bits included, sorted.
std::vector<std::array<int64_t, 3>> leafLattice(const lod::Store& store);

/// A complete frame of placed stores.
render::Image draw(const std::vector<render::PlacedStore>& placed, render::Backend& backend, Executor& executor,
                   const lod::View& view, const render::FrameSettings& settings, FrameCounters* counters = nullptr);
/// A complete frame.
render::Image renderView(std::shared_ptr<const lod::Store> store, render::Backend& backend, Executor& executor,
                         const lod::View& view, const render::FrameSettings& settings,
                         FrameCounters* counters = nullptr);
/// For a frame of a mode with depth and normals; the default error is met by leaves alone.
render::FrameSettings drawnAs(render::Mode mode, double errorPixels = 1e-4, bool isLit = true);
/// The cpu backend on every instruction set that this machine has, and the fp64 restatement.
std::map<std::string, std::unique_ptr<render::Backend>> cpuBackendsAndOracle(Executor& executor);
/// Of what is drawn in either picture, dB.
double drawnPsnr(const render::Image& a, const render::Image& b);
/// 400 x 400 pixels, from 3 units above an object of radius 1.
lod::View viewFromAbove(const glm::dvec3& centre);
lod::View fitView(const lod::Store& store, uint32_t width, uint32_t height);

/// Path of a file of the data folder; empty (with a SKIP line, or a failure if the data is required) where it is
/// missing.
std::string dataFile(const std::string& name);
/// In ./test --full (STIPPLE_LARGE): as often as it takes to be sure; otherwise as often as CI has time for.
inline bool isThorough() { return std::getenv("STIPPLE_LARGE") != nullptr; }

/// Whole files.
std::string slurp(const std::string& path);
void spit(const std::string& path, const std::string& bytes);

/// Compares with tests/golden/NAME.png, a picture that somebody has looked at. With STIPPLE_RENEW_GOLDENS it writes the
/// picture instead, and fails: look at it, then commit it.
void expectGolden(const render::Image& image, const std::string& name);

}  // namespace stipple::test
