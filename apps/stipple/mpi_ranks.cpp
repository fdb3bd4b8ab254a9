#include "apps/stipple/mpi_ranks.h"

#include <mpi.h>

namespace stipple::app {
namespace {

class MpiRanks final : public Ranks {
  public:
    MpiRanks() {
        MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
        MPI_Comm_size(MPI_COMM_WORLD, &count_);
    }
    ~MpiRanks() override { MPI_Finalize(); }
    int rank() const override { return rank_; }
    int count() const override { return count_; }

    std::vector<std::vector<uint8_t>> gather(const std::vector<uint8_t>& mine) override {
        const auto ranks = static_cast<size_t>(count_);
        const auto own = static_cast<int>(mine.size());
        std::vector<int> sizes(ranks), starts(ranks + 1);
        MPI_Allgather(&own, 1, MPI_INT, sizes.data(), 1, MPI_INT, MPI_COMM_WORLD);
        for (size_t r = 0; r < ranks; ++r) starts[r + 1] = starts[r] + sizes[r];
        std::vector<uint8_t> all(static_cast<size_t>(starts[ranks]));
        MPI_Allgatherv(mine.data(), own, MPI_BYTE, all.data(), sizes.data(), starts.data(), MPI_BYTE, MPI_COMM_WORLD);
        std::vector<std::vector<uint8_t>> out;
        for (size_t r = 0; r < ranks; ++r) out.emplace_back(all.begin() + starts[r], all.begin() + starts[r + 1]);
        return out;
    }
    void addUp(std::vector<uint32_t>& values) override {
        MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_UINT32_T, MPI_SUM,
                      MPI_COMM_WORLD);
    }

  private:
    int rank_ = 0, count_ = 1;
};

}  // namespace

Result<MpiJob> joinMpi() {
    int level = 0;
    if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &level) != MPI_SUCCESS || level < MPI_THREAD_FUNNELED)
        return fail(ErrorKind::device, "MPI does not start, or not beside threads", "--mpi", "start it with mpirun");
    MpiJob job;
    job.ranks = std::make_unique<MpiRanks>();
    MPI_Comm here{};
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
    MPI_Comm_size(here, &job.onThisMachine);
    MPI_Comm_free(&here);
    return job;
}

}  // namespace stipple::app
