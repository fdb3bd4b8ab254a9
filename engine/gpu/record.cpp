#include "engine/gpu/record.h"

#include <algorithm>
#include <array>

#include "engine/base/check.h"
#include "engine/gpu/passes/passes.h"
#include "shaders/shared/background.h"
#include "shaders/shared/reflection.h"

namespace stipple::gpu {

Recording::Recording(PassList& list, Pipelines& pipelines, VkCommandBuffer commands, const FrameBuffers& buffers,
                     const render::RenderRequest& request)
    : list_(list), pipelines_(pipelines), commands_(commands), buffers_(buffers), request_(request) {}

bool Recording::has(render::Pass pass) const {
    return std::find(request_.passes.begin(), request_.passes.end(), pass) != request_.passes.end();
}

void Recording::smooth(const std::function<void()>& passes) {
    isSmoothing_ = true;
    passes();
    isSmoothing_ = false;
}

Result<void> Recording::recordPasses() {
    const auto& passes = request_.passes;
    for (size_t p = 0; p < passes.size();) {
        label_ = shader_ = render::passName(passes[p]);
        // Neighbours that read only their own pixel run as one: as many as have a common shader.
        size_t next = p + 1;
        std::string shader = shader_, label = label_;
        for (size_t q = p + 1; q < passes.size() && render::passInfo(passes[q]).isOfOwnPixel; ++q) {
            if (gpuPassOf(passes[q]).isBeside) continue;
            shader += std::string("_") + render::passName(passes[q]);
            label += std::string("+") + render::passName(passes[q]);
            if (shaderNamed(shader) == nullptr) continue;
            shader_ = shader;
            label_ = label;
            next = q + 1;
        }
        for (size_t q = p + 1; q < next; ++q)
            if (gpuPassOf(passes[q]).isBeside) gpuPassOf(passes[q]).record(*this);
        gpuPassOf(passes[next - 1]).record(*this);
        p = next;
    }
    return status_;
}

const Shader& Recording::known(const std::string& name) const {
    const Shader* const shader = shaderNamed(name);
    STIPPLE_CHECK(shader != nullptr, "no shader has the name of a pass");
    return *shader;
}

shared::Step Recording::stepAt(size_t level) const {
    const std::vector<Level>& levels = buffers_.levels();
    const Level &fine = levels[level], &coarse = levels[std::min(level + 1, levels.size() - 1)];
    shared::Step step{};
    const bool hasSmooth = has(render::Pass::smooth);
    step.fine = hasSmooth && !isSmoothing_ ? buffers_.texelsOfPixels() : fine.offset;
    step.fineWidth = fine.width;
    step.fineHeight = fine.height;
    step.coarse = coarse.offset;
    step.coarseWidth = coarse.width;
    step.coarseHeight = coarse.height;
    step.level = static_cast<uint32_t>(level);
    step.wantExtra = request_.wantDepthAndNormal ? 1 : 0;
    step.hasPyramid = (isSmoothing_ || has(render::Pass::push)) && levels.size() > 1 ? 1 : 0;
    step.hasTubes = hasCurves() && !isSmoothing_ ? 1 : 0;
    step.hasTriangles = hasTriangles() ? 1 : 0;
    step.hasWideDiscs = has(render::Pass::discs) || (isSmoothing_ && draws().hasWideDiscs) ? 1 : 0;
    step.exactPoints = render::reconstructionOf(request_.mode).fillsSplats && !isSmoothing_ ? 1 : 0;
    step.hasFiltered = has(render::Pass::ewa) ? 1 : 0;
    step.hasBackground = draws().tableAt<shared::BackgroundConstants>(shared::kBackgroundBinding) != nullptr ? 1 : 0;
    step.hasMirrored = draws().tableAt<shared::ReflectionConstants>(shared::kReflectionBinding) != nullptr ? 1 : 0;
    step.onlySmooth = isSmoothing_ ? 1 : 0;
    step.hasSmooth = hasSmooth && levels.size() > 1 ? 1 : 0;
    step.smoothTexels = levels[0].offset;
    return step;
}

void Recording::dispatch(const std::string& label, const Shader& shader, const shared::Step& step, Groups groups) {
    std::vector<BufferUse> uses;
    for (const BindingUse& u : shader.uses) uses.push_back({buffers_.bound(u.binding).handle(), u.writes});
    if (counts_ != nullptr) uses.push_back({counts_->handle(), false, true});
    list_.begin(label, uses, false);
    if (const auto used = pipelines_.use(commands_, shader); used) {
        if (shader.pushBytes > 0) pipelines_.push(commands_, step);
        if (counts_ != nullptr)
            vkCmdDispatchIndirect(commands_, counts_->handle(),
                                  firstCounts_ + groups.shape * sizeof(shared::GroupCounts));
        else if (groups.x > 0 && groups.y > 0)
            vkCmdDispatch(commands_, groups.x, groups.y, 1);
    } else if (status_) {
        status_ = used;
    }
    list_.end();
}

Recording::Groups Recording::groupsOfBlocks(size_t blocks) {
    constexpr uint32_t kMost = shared::kGroupsPerDimension;
    const auto count = static_cast<uint32_t>(blocks);
    return {shared::kOverBlocks, std::min(count, kMost), (count + kMost - 1) / kMost};
}

Recording::Groups Recording::groupsOfBands() const {
    const uint32_t height = buffers_.levels()[0].height;
    return {shared::kOverBands, shared::kBandGroups, (height + shared::kBandRows - 1) / shared::kBandRows};
}

Recording::Groups Recording::groupsOfPixels(const Shader& shader, size_t level) const {
    const Level& to = buffers_.levels()[level];
    return {shared::kOverPixels, (to.width + shader.group[0] - 1) / shader.group[0],
            (to.height + shader.group[1] - 1) / shader.group[1]};
}

void Recording::overPixels(const std::string& label, const std::string& name, size_t level, size_t target) {
    const Shader& shader = known(name);
    dispatch(label, shader, stepAt(level), groupsOfPixels(shader, target));
}

void Recording::overBlocks(const std::string& name, size_t blocks) {
    shared::Step step = stepAt(0);
    step.count = static_cast<uint32_t>(blocks);
    dispatch(name, known(name), step, groupsOfBlocks(blocks));
}

void Recording::overBands(const std::string& label, const std::string& name, uint32_t firstBlock) {
    shared::Step step = stepAt(0);
    step.firstBlock = firstBlock;
    dispatch(label, known(name), step, groupsOfBands());
}

void Recording::overLevel(const std::string& label, const std::string& name, size_t level, uint32_t ofGroups) {
    counts_ = &buffers_.at(shared::kStatsBinding);
    firstCounts_ = bytesOf(shared::kStatsBinding, 0);  // behind the largest radius
    dispatch(label, known(name), stepAt(level), {ofGroups, 0, 0});
    counts_ = nullptr;
    firstCounts_ = 0;
}

void Recording::once(const std::string& label, const std::string& name, size_t level) {
    dispatch(label, known(name), stepAt(level), {shared::kOverBlocks, 1, 1});
}

void Recording::emptyList(const std::string& label, uint32_t binding) {
    const VkBuffer buffer = buffers_.at(binding).handle();
    list_.begin(label, {{buffer, true}}, true);
    vkCmdFillBuffer(commands_, buffer, 0, 4, 0);
    list_.end();
}

void Recording::noGroups(const std::string& label, uint32_t binding, size_t blocks, const std::string& overPixels) {
    std::array<shared::GroupCounts, shared::kGroupShapes> counts{};
    for (const Groups& g : {groupsOfBlocks(blocks), groupsOfBands(), groupsOfPixels(known(overPixels), 0)})
        counts.at(g.shape) = {g.x, g.y, 0};
    const VkBuffer buffer = buffers_.at(binding).handle();
    list_.begin(label, {{buffer, true}}, true);
    vkCmdUpdateBuffer(commands_, buffer, 0, sizeof(counts), counts.data());
    list_.end();
}

void Recording::whereFound(uint32_t binding, const std::function<void()>& passes) {
    counts_ = &buffers_.at(binding);
    passes();
    counts_ = nullptr;
}

void Recording::fill(const std::string& label, std::initializer_list<std::pair<uint32_t, uint32_t>> bindingsAndWords) {
    std::vector<BufferUse> uses;
    for (const auto& [binding, word] : bindingsAndWords) uses.push_back({buffers_.at(binding).handle(), true});
    list_.begin(label, uses, true);
    for (const auto& [binding, word] : bindingsAndWords)
        vkCmdFillBuffer(commands_, buffers_.at(binding).handle(), 0, VK_WHOLE_SIZE, word);
    list_.end();
}

}  // namespace stipple::gpu
