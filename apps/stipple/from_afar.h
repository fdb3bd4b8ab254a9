// What is seen of things from afar: points in place of meshes and strands, and crowds of them.
#pragma once

#include <string>

#include "apps/stipple/common.h"
#include "engine/scene/triangles.h"
#include "lod/strands.h"

namespace stipple::app {

using StandIns = std::shared_ptr<const std::vector<render::StandIn>>;

/// Of a mesh whose coarsest level still has many triangles: what is made of many small separate parts cannot be
/// simplified as a surface. Null where it can.
Result<StandIns> meshFromAfar(const scene::Scene& scene, const std::vector<scene::Placement>& of,
                              const lod::Store& mesh, const std::string& part, const BuildOptions& build,
                              Executor& executor, bool showProgress);

/// Of strands: fewer and fewer discs (lod/build/strands/strand_samples.h), each time a quarter. Null where there are
/// few strands.
Result<StandIns> strandsFromAfar(const lod::StrandSet& clean, const std::string& input, const std::string& part,
                                 const BuildOptions& build, Executor& executor, bool showProgress);

/// Collects what stands in many places, and makes one store of points of all of them.
class CrowdBuilder {
  public:
    /// Placed stores [first, first + count) show `clean`.
    void add(const lod::StrandSet& clean, uint32_t first, uint32_t count);
    /// Adds a crowd to the scene, if there is enough of one.
    Result<void> finish(const std::string& input, const BuildOptions& build, Executor& executor, bool showProgress,
                        OpenedScene& scene);

  private:
    struct Model {
        lod::StrandSet strands;
        uint32_t first, count;
    };
    std::vector<Model> models_;
};

}  // namespace stipple::app
