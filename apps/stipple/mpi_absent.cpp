#include "apps/stipple/mpi_ranks.h"

namespace stipple::app {

Result<MpiJob> joinMpi() {
    return fail(ErrorKind::usage, "this program was built without MPI", "--mpi",
                "install Open MPI (libopenmpi-dev openmpi-bin) and configure again");
}

}  // namespace stipple::app
