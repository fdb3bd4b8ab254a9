// Proxies, what is seen of things from afar: points in place of meshes and curves, and instance groups of them.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "engine/scene/open/open_scene.h"
#include "engine/scene/triangles.h"
#include "lod/builder/stochastic/stochastic_build.h"
#include "lod/primitives/curves.h"

namespace stipple::scene {

using Proxies = std::shared_ptr<const std::vector<render::Proxy>>;

/// Of a mesh whose coarsest level still has many triangles: what is made of many small separate parts cannot be
/// simplified as a surface. Null where it can.
Result<Proxies> meshProxies(const scene::Scene& scene, const std::vector<scene::Placement>& of, const lod::Store& mesh,
                            const std::string& part, const OpenSettings& build, Executor& executor);

/// Clean curves and their samples, made when they are needed: what is in the cache does not need them.
class CurveModel {
  public:
    CurveModel(std::function<lod::CurveSet()> make, Executor& executor) : make_(std::move(make)), executor_(executor) {}
    const lod::CurveSet& curves();
    const lod::CurveSamples& samples();
    const lod::DiscFactors& factors();

  private:
    std::function<lod::CurveSet()> make_;
    Executor& executor_;
    std::optional<lod::CurveSet> curves_;
    std::optional<lod::CurveSamples> samples_;
    std::optional<lod::DiscFactors> factors_;
};
using SharedModel = std::shared_ptr<CurveModel>;

/// Of curves, which `of` holds: discs, as few as the view allows (lod/builder/stochastic). Null where there are few
/// curves.
Result<Proxies> curveProxies(const SharedModel& model, const lod::Store& of, const std::string& input,
                             const std::string& part, const OpenSettings& build, Executor& executor);

/// Collects what stands in many places, and makes one stochastic store of all of it.
class GroupBuilder {
  public:
    /// Placed stores [first, first + count) show `model`.
    void add(const SharedModel& model, uint32_t first, uint32_t count);
    /// Adds an instance group to the scene, if there is enough of one.
    Result<void> finish(const std::string& input, const OpenSettings& build, Executor& executor, OpenedScene& scene);

  private:
    struct Model {
        SharedModel model;
        uint32_t first, count;
    };
    std::vector<Model> models_;
};

}  // namespace stipple::scene
