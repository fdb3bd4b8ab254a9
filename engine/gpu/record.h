// What the passes of a frame are recorded with: dispatches over pixels, blocks and bands. The buffers that a dispatch
// reads and writes are those of its shader (shader_table.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "engine/gpu/frame_buffers.h"
#include "engine/gpu/pass_list.h"
#include "engine/gpu/pipelines.h"

namespace stipple::gpu {

class Recording {
  public:
    Recording(PassList& list, Pipelines& pipelines, VkCommandBuffer commands, const FrameBuffers& buffers,
              const render::RenderRequest& request);

    /// All passes of the request. Error: a pipeline that cannot be made.
    Result<void> recordPasses();

    const render::DrawList& draws() const { return *request_.draws; }
    const FrameBuffers& buffers() const { return buffers_; }
    bool has(render::Pass pass) const;
    /// Draws with `passes` what mode surface takes colours and normals from: nothing but smooth nodes, into the levels
    /// of the pyramid. What is drawn after them has the texels of its pixels elsewhere.
    void smooth(const std::function<void()>& passes);
    bool hasCurves() const { return !draws().curves().isEmpty(); }
    bool hasTriangles() const { return draws().hasSurfaces(); }
    /// Of the pass at hand, or of it and its neighbour where they have a common one.
    const std::string& shader() const { return shader_; }
    const std::string& label() const { return label_; }

    /// One thread a pixel of level `target`; the step is from `level` to the next.
    void overPixels(const std::string& label, const std::string& shader, size_t level = 0, size_t target = 0);
    /// One group a block of draw ids (a cluster); what the first block of the kind is.
    void overBlocks(const std::string& shader, size_t blocks);
    /// Groups for bands of rows: what covers many pixels is shared out. `firstBlock`: of the ids that are drawn.
    void overBands(const std::string& label, const std::string& shader, uint32_t firstBlock = 0);
    /// One thread a texel, if the device has found that the level holds any (`ofGroups`: of levelGroups in
    /// shaders/bindings.glsl); the step is from `level` to the next.
    void overLevel(const std::string& label, const std::string& shader, size_t level, uint32_t ofGroups);
    /// One group; the step is from `level` to the next.
    void once(const std::string& label, const std::string& shader, size_t level = 0);
    /// A list of what covers many pixels begins with its length.
    void emptyList(const std::string& label, uint32_t binding);
    /// Counts of groups begin with as many as there are of blocks, bands and pixels, and none of them on (GroupCounts).
    /// `overPixels`: a shader whose groups are as large as those of all that are counted there.
    void noGroups(const std::string& label, uint32_t binding, size_t blocks, const std::string& overPixels);
    /// Records `passes`, which do nothing on the device where no dispatch before them has put on the groups that it
    /// counts in `binding`.
    void whereFound(uint32_t binding, const std::function<void()>& passes);
    /// Buffers full of one word, side by side.
    void fill(const std::string& label, std::initializer_list<std::pair<uint32_t, uint32_t>> bindingsAndWords);

  private:
    struct Groups {
        uint32_t shape, x, y;  ///< shape: kOverBlocks ...
    };
    static Groups groupsOfBlocks(size_t blocks);
    Groups groupsOfBands() const;
    Groups groupsOfPixels(const Shader& shader, size_t level) const;
    void dispatch(const std::string& label, const Shader& shader, const shared::Step& step, Groups groups);
    shared::Step stepAt(size_t level) const;
    const Shader& known(const std::string& name) const;

    PassList& list_;
    Pipelines& pipelines_;
    VkCommandBuffer commands_;
    const FrameBuffers& buffers_;
    const render::RenderRequest& request_;
    std::string shader_, label_;
    bool isSmoothing_ = false;
    const Buffer* counts_ = nullptr;  ///< of groups, where dispatches find theirs
    uint64_t firstCounts_ = 0;        ///< bytes, in that buffer
    Result<void> status_;             ///< the first error
};

}  // namespace stipple::gpu
