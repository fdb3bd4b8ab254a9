// What nearly every test includes, read by the compiler once (STIPPLE_PRECOMPILED).
#pragma once

#include <gtest/gtest.h>

#include "engine/base/precompiled.h"
#include "tests/support/support.h"
