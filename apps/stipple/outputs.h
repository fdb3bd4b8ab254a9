// What a command is going to write, looked at before it does any work: nothing that it reads is written over, and
// nothing else is destroyed unasked.
#pragma once

#include <string>
#include <vector>

#include "engine/base/result.h"

namespace CLI {
class App;
}  // namespace CLI

namespace stipple::app {

/// A picture may stand where a picture stood, a store where a store stood (by their bytes, not by their names).
enum class OutputKind { picture, store, other };

struct Output {
    std::string path;
    OutputKind kind = OutputKind::other;
};

/// Refuses an output that is the same file as an input, whatever either is called, and one that is there and of another
/// kind, unless `force` is given; also what cannot be a file (outputTarget). `inputs` as named: files, folders,
/// patterns, scenes with all that they refer to; empty ones are none.
Result<void> checkOutputs(const std::vector<Output>& outputs, const std::vector<std::string>& inputs, bool force);

/// What is there already of NAME_0000.png, NAME_0001.png ...
std::vector<Output> numberedPictures(const std::string& path);

void addForce(CLI::App& app, bool& force);

}  // namespace stipple::app
