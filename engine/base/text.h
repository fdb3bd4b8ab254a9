// Text from files and from the command line on its way to a person: names there are any bytes.
#pragma once

#include <string>
#include <string_view>

namespace stipple {

/// The same text as valid UTF-8 of one line that a terminal only prints: control characters (C0, DEL and C1, which can
/// steer a terminal) and bytes that are not UTF-8 (RFC 3629) as \xNN. Different texts stay different but for those that
/// already hold such a sequence.
std::string printable(std::string_view text);

/// The same for formats that can hold control characters (JSON, coordinate systems of several lines): only what is not
/// UTF-8 is changed.
std::string toUtf8(std::string_view text);

}  // namespace stipple
