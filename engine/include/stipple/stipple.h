// All of it.
#pragma once

#include <stipple/build.h>
#include <stipple/image.h>
#include <stipple/progress.h>
#include <stipple/renderer.h>
#include <stipple/result.h>
#include <stipple/scene.h>
#include <stipple/store.h>
#include <stipple/view.h>
