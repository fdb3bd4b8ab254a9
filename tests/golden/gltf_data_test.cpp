// The Khronos validator's corpus and real glTF files: error files are refused with a reason, real ones are read.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "engine/scene/gltf/check.h"
#include "engine/scene/scene.h"
#include "engine/scene/triangles.h"
#include "tests/support/support.h"

namespace stipple::scene::gltf {
namespace {

Result<void> open(const std::string& path) {
    STIPPLE_ASSIGN(Container c, readContainer(path));
    Buffers buffers(c);
    STIPPLE_TRY(requireGood(c, buffers, true));
    return {};
}

TEST(GltfData, TheValidatorsErrorFilesAreRefusedAndNoOthers) {
    const std::string root = test::dataFile("09_hostile/gltf-validator");
    if (root.empty()) return;
    // Warnings of the validator that we cannot read past: a type, a place and an image format that are not known.
    const std::set<std::string> alsoRefused{"accessor/unknown_type.gltf", "buffer/non_relative_uri.gltf",
                                            "image/unrecognized_format.gltf"};
    size_t errors = 0, fine = 0, unknown = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const std::string name = entry.path().filename().string();
        const std::string suffix = ".report.json";
        if (name.size() < suffix.size() || name.compare(name.size() - suffix.size(), suffix.size(), suffix) != 0)
            continue;
        const std::string path = entry.path().string().substr(0, entry.path().string().size() - suffix.size());
        std::ifstream in(entry.path());
        const auto report = nlohmann::json::parse(in);
        const bool isError = report["issues"]["numErrors"].get<int>() > 0;
        const std::filesystem::path p(path);
        const std::string shortName = (p.parent_path().filename() / p.filename()).string();
        const auto result = open(path);
        if (isError) {
            ++errors;
            EXPECT_FALSE(result) << path;
            if (!result) EXPECT_EQ(result.error().line().find('\n'), std::string::npos) << path;
        } else if (!result && result.error().what.find("requires the extension") != std::string::npos) {
            ++unknown;  // valid, but of an extension that we do not have: refused by name
        } else {
            ++fine;
            EXPECT_EQ(result.has_value(), alsoRefused.count(shortName) == 0)
                << path << (result ? "" : ": " + result.error().line());
        }
    }
    EXPECT_EQ(errors, 243u);
    EXPECT_GT(fine, 110u);
    EXPECT_LT(unknown, 10u);
}

TEST(GltfData, BrokenObjFilesAreSurvived) {
    const std::string root = test::dataFile("09_hostile");
    if (root.empty()) return;
    size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        if (entry.path().extension() != ".obj") continue;
        ++files;
        if (const auto scene = readObj(entry.path())) {
            for (const Primitive& p : scene->meshes[0].primitives)
                for (const uint32_t i : p.indices) ASSERT_LT(i, p.position.size()) << entry.path();
        } else {
            EXPECT_EQ(scene.error().line().find('\n'), std::string::npos) << entry.path();
        }
    }
    EXPECT_GT(files, 20u);
}

TEST(GltfData, WhatIsOnlyAgainstTheRulesIsReadWithANoteAndNothingBreaks) {
    const std::string root = test::dataFile("09_hostile/gltf-validator");
    if (root.empty()) return;
    size_t refused = 0, passed = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const std::string extension = entry.path().extension();
        if (extension != ".gltf" && extension != ".glb") continue;
        const bool isGood = open(entry.path()).has_value();
        const auto scene = readGltf(entry.path());
        if (!scene) {
            ++refused;
            EXPECT_EQ(scene.error().line().find("exception"), std::string::npos) << scene.error().line();
            continue;
        }
        passed += isGood ? 0 : 1;
        if (!isGood) EXPECT_FALSE(scene->notes.empty()) << entry.path();
        for (const Placement& p : placements(*scene))
            EXPECT_TRUE(triangleSource(*scene, {p}).read([](const lod::TriangleMesh&) -> Result<void> { return {}; }));
        (void)surfaceMaterials(*scene);
    }
    EXPECT_GT(passed, 100u);
    EXPECT_GT(refused, 60u);
    // Real files of other programs that are only wrong in such ways are drawn.
    for (const char* name : {"06_gltf/mode5.gltf", "06_gltf/tinygltf/Cube-texture-ext/Cube-textransform.gltf",
                             "06_gltf/tinygltf/regression/unassigned-skeleton.gltf"}) {
        const auto scene = readGltf(test::dataFile(name));
        ASSERT_TRUE(scene) << scene.error().line();
        EXPECT_FALSE(scene->notes.empty());
    }
}

TEST(GltfData, RealFilesAreValid) {
    const std::string root = test::dataFile("06_gltf");
    if (root.empty()) return;
    // What these files do wrong, or need that is not there.
    const std::map<std::string, std::string> refused{{"mode5.gltf", "'min'"},
                                                     {"invalid-buffer-index.gltf", "/bufferViews/1/buffer"},
                                                     {"invalid-buffer-view-index.gltf", "/accessors/0/bufferView"},
                                                     {"invalid-primitive-indices.gltf", "/accessors/0/bufferView"},
                                                     {"integer-out-of-bounds.gltf", "too large"},
                                                     {"unassigned-skeleton.gltf", "byteStride"},
                                                     {"Cube-textransform.gltf", "extensionsUsed"},
                                                     {"MeshoptCubeTest.gltf", "KHR_meshopt_compression"}};
    size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
        const std::string extension = entry.path().extension();
        if (extension != ".gltf" && extension != ".glb") continue;
        ++files;
        const auto result = open(entry.path());
        const auto known = refused.find(entry.path().filename().string());
        if (known != refused.end()) {
            ASSERT_FALSE(result) << entry.path();
            EXPECT_NE(result.error().line().find(known->second), std::string::npos) << result.error().line();
        } else if (!result) {
            EXPECT_NE(result.error().what.find("requires the extension"), std::string::npos) << result.error().line();
        }
    }
    EXPECT_GE(files, 25u);
}

}  // namespace
}  // namespace stipple::scene::gltf
