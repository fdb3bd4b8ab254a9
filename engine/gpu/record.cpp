#include "engine/gpu/record.h"

#include <algorithm>
#include <map>

namespace stipple::gpu {
namespace {

constexpr uint32_t kLargeGroups = 64, kLargeRows = 16;  // see shaders/rasterise
constexpr uint32_t kGroup = 64, kGroupsPerDimension = 65535;

BufferUse write(const Buffer& b) { return {b.handle(), true}; }
BufferUse read(const Buffer& b) { return {b.handle(), false}; }

/// `count`: what else a pass needs to know, see Step of shaders/bindings.glsl.
void pushStep(const Recording& f, size_t level, uint32_t count) {
    const Level& fine = f.levels[level];
    const Level& coarse = f.levels[std::min(level + 1, f.levels.size() - 1)];
    f.pipelines.push(f.commands, {fine.offset, fine.width, fine.height, coarse.offset, coarse.width, coarse.height,
                                  static_cast<uint32_t>(level), f.wantAll, f.hasPyramid && f.levels.size() > 1,
                                  !f.draws.curves().isEmpty(), count});
}

/// One thread a pixel of a level.
void overPixels(const Recording& f, const char* label, const char* pipeline, const std::vector<BufferUse>& uses,
                size_t level = 0, uint32_t count = 0, size_t target = 0) {
    f.list.begin(label, uses, false);
    f.pipelines.use(f.commands, pipeline);
    pushStep(f, level, count);
    vkCmdDispatch(f.commands, (f.levels[target].width + kGroup - 1) / kGroup, f.levels[target].height, 1);
    f.list.end();
}

/// One group a block of draw ids (a cluster).
void overBlocks(const Recording& f, const char* label, const std::vector<BufferUse>& uses, size_t blocks,
                uint32_t count) {
    f.list.begin(label, uses, false);
    f.pipelines.use(f.commands, label);
    pushStep(f, 0, count);
    const auto n = static_cast<uint32_t>(blocks);
    if (n > 0)
        vkCmdDispatch(f.commands, std::min(n, kGroupsPerDimension), (n + kGroupsPerDimension - 1) / kGroupsPerDimension,
                      1);
    f.list.end();
}

/// Groups for bands of rows: what covers many pixels is shared out.
void overBands(const Recording& f, const char* label, const char* pipeline, const std::vector<BufferUse>& uses,
               uint32_t count = 0) {
    f.list.begin(label, uses, false);
    f.pipelines.use(f.commands, pipeline);
    pushStep(f, 0, count);
    vkCmdDispatch(f.commands, kLargeGroups, (f.levels[0].height + kLargeRows - 1) / kLargeRows, 1);
    f.list.end();
}

/// A list of what covers many pixels begins with its length.
void emptyList(const Recording& f, const char* label, const Buffer& buffer) {
    f.list.begin(label, {write(buffer)}, true);
    vkCmdFillBuffer(f.commands, buffer.handle(), 0, 4, 0);
    f.list.end();
}

void clear(const Recording& f) {
    f.list.begin("clear", {write(f.buffers.visibility), write(f.buffers.stats)}, true);
    vkCmdFillBuffer(f.commands, f.buffers.visibility.handle(), 0, VK_WHOLE_SIZE, 0xffffffffu);
    vkCmdFillBuffer(f.commands, f.buffers.stats.handle(), 0, VK_WHOLE_SIZE, 0);
    f.list.end();
}

void project(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    const bool hasDiscs = f.mode.hasPyramid && f.draws.hasWideDiscs;
    if (hasDiscs) emptyList(f, "disc list", b.discs);
    // Without a list the buffer of measures is bound in its stead: layers take it for written.
    const std::vector<BufferUse> uses{write(b.visibility), write(hasDiscs ? b.discs : b.stats)};
    overBlocks(f, "project", uses, f.draws.points().blocks.size(), hasDiscs ? 1 : 0);
}

void discs(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    f.list.begin("disc order", {write(b.discs)}, false);
    f.pipelines.use(f.commands, "disc_order");
    vkCmdDispatch(f.commands, 1, 1, 1);
    f.list.end();
    overBands(f, "discs", "discs", {write(b.visibility), read(b.discs)}, f.draws.frame.firstBlock.discs);
}

void splat(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    emptyList(f, "disc list", b.discs);
    overBlocks(f, "splat", {write(b.visibility), write(b.discs)}, f.draws.points().blocks.size(), 0);
    overBands(f, "discs", "discs", {write(b.visibility), read(b.discs)});
}

void curves(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    emptyList(f, "wide list", b.wide);
    const size_t blocks = f.draws.curves().blocks.size();
    overBlocks(f, "strands", {write(b.visibility), write(b.wide)}, blocks, static_cast<uint32_t>(blocks));
    overBands(f, "wide strands", "strands_wide", {write(b.visibility), read(b.wide)});
}

void rasterise(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    emptyList(f, "large list", b.large);
    overBlocks(f, "rasterise", {write(b.visibility), write(b.large)}, f.clusters, f.clusters);
    overBands(f, "rasterise large", "rasterise_large", {write(b.visibility), read(b.large)});
}

void resolve(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    overPixels(f, "resolve", "resolve", {read(b.visibility), write(b.texels), write(b.stats)}, 0,
               f.mode.fillsSplats ? 1 : 0);
    if (f.mode.hasPyramid && f.draws.hasWideDiscs)
        overPixels(f, "disc texels", "disc_texels", {read(b.visibility), read(b.discs), write(b.texels)});
    if (!f.draws.curves().isEmpty())
        overPixels(f, "strand texels", "strand_texels", {read(b.visibility), write(b.texels), write(b.stats)});
    if (!f.draws.triangles().isEmpty())
        overPixels(f, "triangle texels", "triangle_texels",
                   {read(b.visibility), write(b.texels), write(b.triangleWords)});
}

void pull(const Recording& f) {
    for (size_t l = 0; l + 1 < f.levels.size(); ++l)
        overPixels(f, "pull", "pull", {write(f.buffers.texels), read(f.buffers.stats)}, l, 0, l + 1);
}

/// Down to level 1: the last push fills the surface buffer.
void push(const Recording& f) {
    for (size_t l = f.levels.size() - 1; l-- > 1;)
        overPixels(f, "push", "push", {write(f.buffers.texels), read(f.buffers.stats)}, l, 0, l);
}

void surface(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    const bool hasTriangles = !f.draws.triangles().isEmpty();
    std::vector<BufferUse> uses{read(b.texels), write(b.surface)};
    if (hasTriangles) uses.push_back(read(b.triangleWords));
    overPixels(f, "surface", "surface", uses, 0, hasTriangles ? 1 : 0);
}

void output(const Recording& f) {
    const FrameBuffers& b = f.buffers;
    std::vector<BufferUse> uses{read(b.surface), write(b.image), write(b.extra)};
    if (f.isLit && !f.draws.triangles().isEmpty()) uses.push_back(read(b.triangleWords));
    overPixels(f, f.isLit ? "light+output" : "output", f.isLit ? "output_lit" : "output", uses);
}

}  // namespace

void recordPass(const Recording& frame, render::Pass pass) {
    using render::Pass;
    static const std::map<Pass, void (*)(const Recording&)> kTable{
        {Pass::clear, clear},    {Pass::project, project},     {Pass::discs, discs},     {Pass::splat, splat},
        {Pass::strands, curves}, {Pass::rasterise, rasterise}, {Pass::resolve, resolve}, {Pass::pull, pull},
        {Pass::push, push},      {Pass::surface, surface},     {Pass::output, output},
    };
    // Light runs in the pass of the output.
    if (const auto found = kTable.find(pass); found != kTable.end()) found->second(frame);
}

}  // namespace stipple::gpu
