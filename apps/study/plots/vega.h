// Charts as Vega-Lite 5 specifications that hold their data.
#pragma once

#include <nlohmann/json.hpp>

#include "apps/study/plots/chart.h"

namespace stipple::study {

nlohmann::json vegaOf(const Chart& chart);
nlohmann::json vegaOf(const BarChart& chart);

}  // namespace stipple::study
