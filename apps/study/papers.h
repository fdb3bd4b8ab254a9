// What the papers' tables say, and what stands in for their models here.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stipple::study {

struct ModelRow {
    const char* paper;
    const char* model;            ///< theirs
    uint64_t points;              ///< theirs; ours are as many
    const char* file;             ///< below the data folder; empty: a checker plane
    const char* proxy;            ///< ours, in words
    const char* theirs;           ///< their fps, in words
    std::vector<uint32_t> sizes;  ///< px, square
};
/// Tables of Botsch & Kobbelt 2003 (1), Ren et al. 2002 (1 and 2), Marroquim et al. 2008 (1).
std::span<const ModelRow> modelRows();

}  // namespace stipple::study
