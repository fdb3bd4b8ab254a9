#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/stipple/common.h"
#include "apps/stipple/options.h"
#include "apps/stipple/outputs.h"
#include "engine/image/image_io.h"
#include "engine/reference/reference.h"

namespace stipple::app {
namespace {

struct CompareCommand {
    std::string a, b, diff;
    int threshold = 4;
    bool json = false, force = false;
};

Result<void> run(const CompareCommand& o) {
    if (!o.diff.empty()) {
        STIPPLE_TRY(image::checkImagePath(o.diff));
        STIPPLE_TRY(checkOutputs({{o.diff, OutputKind::picture}}, {o.a, o.b}, o.force));
    }
    STIPPLE_ASSIGN(const render::Image a, image::readImage(o.a));
    STIPPLE_ASSIGN(const render::Image b, image::readImage(o.b));
    render::Image difference;
    auto compared = reference::compareImages(a, b, o.threshold, o.diff.empty() ? nullptr : &difference);
    if (!compared) {
        compared.error().where = o.a + ", " + o.b;
        return tl::unexpected(compared.error());
    }
    if (!o.diff.empty()) STIPPLE_TRY(image::writeImage(o.diff, difference));
    const auto& d = *compared;
    if (o.json) {
        const nlohmann::json j = {{"psnr", jsonNumber(d.psnr)},
                                  {"foreground_psnr", jsonNumber(d.foregroundPsnr)},
                                  {"max_diff", d.maxDiff},
                                  {"differing_fraction", d.differingFraction},
                                  {"threshold", o.threshold},
                                  {"silhouette_iou", d.hasCoverage ? nlohmann::json(d.silhouetteIou) : nullptr},
                                  {"holes", d.hasCoverage ? nlohmann::json(d.holes) : nullptr}};
        printJson("compare", j);
    } else {
        fmt::print(
            "PSNR {:.2f} dB (foreground {:.2f} dB), largest difference {}/255, {:.4f} % of the pixels differ by more "
            "than {}/255, {}\n",
            d.psnr, d.foregroundPsnr, d.maxDiff, 100 * d.differingFraction, o.threshold,
            d.hasCoverage ? fmt::format("silhouette IoU {:.5f}, holes {}", d.silhouetteIou, d.holes)
                          : "silhouettes not known: both pictures are opaque (render them with --alpha)");
    }
    return {};
}

}  // namespace

void setupCompare(CLI::App& app, int& status) {
    auto o = std::make_shared<CompareCommand>();
    CLI::App* sub = app.add_subcommand("compare", "how far picture A is from the reference B");
    sub->add_option("A", o->a, "a picture (.png, .exr)")->required();
    sub->add_option("B", o->b, "the reference")->required();
    sub->add_option("--diff", o->diff, "write the differences, eight times enlarged, as a picture")
        ->type_name("PICTURE");
    sub->add_option("--threshold", o->threshold, "channel difference that counts as differing, of 255")
        ->transform(within(0, 255))
        ->capture_default_str();
    sub->add_flag("--json", o->json, "print the measures as JSON (stipple help json)");
    addForce(*sub, o->force);
    sub->callback([o, &status] {
        if (const auto result = run(*o); !result) status = report(result.error());
    });
}

}  // namespace stipple::app
