// What tests of the library share: folders of their own, a scan, a device.
#pragma once

#include <gtest/gtest.h>
#include <stipple/stipple.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace stipple_test {
namespace fs = std::filesystem;

struct Cache {
    Cache() {
        std::string pattern = (fs::temp_directory_path() / "stipple-api-XXXXXX").string();
        folder = ::mkdtemp(pattern.data());
        ::setenv("XDG_CACHE_HOME", folder.c_str(), 1);
    }
    ~Cache() { fs::remove_all(folder); }
    fs::path folder;
};

class Api : public testing::Test {
  protected:
    Api() {
        std::string pattern = (fs::temp_directory_path() / "stipple-api-XXXXXX").string();
        folder_ = ::mkdtemp(pattern.data());
        static const Cache cache;  // a process has one
    }
    ~Api() override { fs::remove_all(folder_); }
    std::string at(const std::string& name) const { return (folder_ / name).string(); }
    static std::string bytesOf(const std::string& path) {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    /// Points of a ball of radius 1 about (x, 0, 0).
    std::string writeBall(const std::string& name, double x = 0, int points = 4000) const {
        std::ofstream out(at(name));
        out << "ply\nformat ascii 1.0\nelement vertex " << points
            << "\nproperty double x\nproperty double y\nproperty double z\n"
               "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
        for (int i = 0; i < points; ++i) {
            const double z = 1 - 2 * (i + 0.5) / points, r = std::sqrt(1 - z * z), a = 2.399963 * i;
            out << x + r * std::cos(a) << ' ' << r * std::sin(a) << ' ' << z << ' ' << i % 256 << " 90 200\n";
        }
        return at(name);
    }
    stipple::Scene sceneOf(const std::string& name, double x = 0) const {
        auto scene = stipple::Scene::open({writeBall(name, x)});
        EXPECT_TRUE(scene) << scene.error().line();
        return std::move(*scene);
    }
    static stipple::Device device() { return std::move(stipple::Device::open("cpu", 2).value()); }
    static stipple::Renderer renderer(const stipple::Device& device, const stipple::Scene& scene) {
        return std::move(stipple::Renderer::create(device, scene).value());
    }
    fs::path folder_;
};

}  // namespace stipple_test
