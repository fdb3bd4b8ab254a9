// Faces of very many corners in OBJ files, as triangles: the library that reads the files takes a time that grows with
// the square of the corners.
#pragma once

#include <glm/glm.hpp>
#include <istream>
#include <streambuf>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/byte_source.h"

namespace stipple::scene {

/// Is there one? (Looks at the lengths of lines, at the speed of memory.)
Result<bool> hasLargeFaces(const ByteSource& file);

/// The text of an OBJ file with triangles instead of its large faces.
class SplitFaces final : public std::streambuf {
  public:
    explicit SplitFaces(std::streambuf& from) : from_(&from) {}

  protected:
    int_type underflow() override;

  private:
    std::string triangles(std::string_view line) const;
    std::istream from_;
    std::string line_;
    std::vector<glm::dvec3> positions_;
};

}  // namespace stipple::scene
