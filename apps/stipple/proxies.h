// Proxies, what is seen of things from afar: points in place of meshes and strands, and instance groups of them.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "apps/stipple/common.h"
#include "engine/scene/triangles.h"
#include "lod/builder/stochastic/stochastic_build.h"
#include "lod/primitives/strands.h"

namespace stipple::app {

using Proxies = std::shared_ptr<const std::vector<render::Proxy>>;

/// Of a mesh whose coarsest level still has many triangles: what is made of many small separate parts cannot be
/// simplified as a surface. Null where it can.
Result<Proxies> meshProxies(const scene::Scene& scene, const std::vector<scene::Placement>& of, const lod::Store& mesh,
                            const std::string& part, const BuildOptions& build, Executor& executor, bool showProgress);

/// Clean strands and their samples, made when they are needed: what is in the cache does not need them.
class StrandModel {
  public:
    StrandModel(std::function<lod::StrandSet()> make, Executor& executor)
        : make_(std::move(make)), executor_(executor) {}
    const lod::StrandSet& strands();
    const lod::StrandSamples& samples();
    const lod::DiscFactors& factors();

  private:
    std::function<lod::StrandSet()> make_;
    Executor& executor_;
    std::optional<lod::StrandSet> strands_;
    std::optional<lod::StrandSamples> samples_;
    std::optional<lod::DiscFactors> factors_;
};
using SharedModel = std::shared_ptr<StrandModel>;

/// Of strands, which `of` holds: discs, as few as the view allows (lod/builder/stochastic). Null where there are few
/// strands.
Result<Proxies> strandProxies(const SharedModel& model, const lod::Store& of, const std::string& input,
                              const std::string& part, const BuildOptions& build, Executor& executor,
                              bool showProgress);

/// Collects what stands in many places, and makes one stochastic store of all of it.
class GroupBuilder {
  public:
    /// Placed stores [first, first + count) show `model`.
    void add(const SharedModel& model, uint32_t first, uint32_t count);
    /// Adds an instance group to the scene, if there is enough of one.
    Result<void> finish(const std::string& input, const BuildOptions& build, Executor& executor, bool showProgress,
                        OpenedScene& scene);

  private:
    struct Model {
        SharedModel model;
        uint32_t first, count;
    };
    std::vector<Model> models_;
};

}  // namespace stipple::app
