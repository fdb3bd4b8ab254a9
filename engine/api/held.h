// What the public classes hold.
#pragma once

#include "engine/api/convert.h"

#include <atomic>
#include <memory>

#include <stipple/renderer.h>

#include "engine/base/executor.h"
#include "engine/render/backend.h"
#include "engine/scene/open/open_scene.h"
#include "lod/store/store.h"

namespace stipple::v1 {

struct Store::Held {
    std::shared_ptr<const lod::Store> store;
};

struct Scene::Held {
    scene::OpenedScene opened;
    lod::ColourBy colour;
};

struct Device::Held {
    std::unique_ptr<Executor> executor;
    std::unique_ptr<render::Backend> backend;  // ends before its workers
    std::atomic_flag isBusy;
};

}  // namespace stipple::v1
