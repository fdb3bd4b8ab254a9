// Ranks of an MPI job.
#pragma once

#include <memory>

#include "engine/base/ranks.h"

namespace stipple::app {

struct MpiJob {
    std::unique_ptr<Ranks> ranks;  ///< ends the job when it goes
    int onThisMachine = 1;         ///< how many of them
};
/// Joins the job that mpirun started; fails where the program was built without MPI.
Result<MpiJob> joinMpi();

}  // namespace stipple::app
