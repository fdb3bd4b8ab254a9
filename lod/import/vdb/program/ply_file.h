// Rows of a binary PLY file, whose header is written last: how many rows there are is known only then.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/result.h"

namespace stipple::vdb {

class PlyFile {
  public:
    explicit PlyFile(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
        if (file_) std::fwrite(std::string(kHeaderBytes, ' ').data(), 1, kHeaderBytes, file_);
    }
    ~PlyFile() {
        if (file_) std::fclose(file_);
    }
    PlyFile(const PlyFile&) = delete;
    PlyFile& operator=(const PlyFile&) = delete;

    template <typename T>
    void put(const T& value) {
        const auto at = row_.size();
        row_.resize(at + sizeof(T));
        std::memcpy(row_.data() + at, &value, sizeof(T));
        if (row_.size() >= kBlock) flush();
    }
    /// `properties`: (type, name) of a vertex; `faces` of three corners each follow the vertices.
    Result<void> finish(uint64_t vertices, const std::vector<std::pair<std::string, std::string>>& properties,
                        uint64_t faces) {
        flush();
        std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(vertices) + "\n";
        for (const auto& [type, name] : properties) header += "property " + type + " " + name + "\n";
        if (faces > 0)
            header += "element face " + std::to_string(faces) + "\nproperty list uchar uint vertex_indices\n";
        const std::string end = "end_header\n", comment = "comment ";
        if (header.size() + end.size() + comment.size() + 1 > kHeaderBytes)
            return fail(ErrorKind::input, "has more attributes than can be taken over", "");
        header += comment + std::string(kHeaderBytes - header.size() - comment.size() - 1 - end.size(), '.') + "\n";
        header += end;
        if (file_ && !hasFailed_) {
            std::rewind(file_);
            hasFailed_ = std::fwrite(header.data(), 1, header.size(), file_) != header.size();
        }
        const bool isClosed = file_ && std::fclose(std::exchange(file_, nullptr)) == 0;
        if (hasFailed_ || !isClosed)
            return fail(ErrorKind::output, "cannot be written: is there room for temporary files?", path_,
                        "--temp names another folder");
        return {};
    }

  private:
    static constexpr size_t kHeaderBytes = 8192, kBlock = size_t{1} << 20;
    void flush() {
        if (!file_ || std::fwrite(row_.data(), 1, row_.size(), file_) != row_.size()) hasFailed_ = true;
        row_.clear();
    }
    std::string path_;
    std::FILE* file_;
    std::vector<char> row_;
    bool hasFailed_ = false;
};

}  // namespace stipple::vdb
