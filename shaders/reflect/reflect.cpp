// Reads compiled shaders (SPIR-V) and writes a C++ table of them: code, size of a workgroup and bytes that it shares,
// bytes of push constants, and of each buffer whether it is read or written and how its elements lie. What a pass uses
// is thus what its shader says.
//
//   stipple_reflect OUT.inc A.spv B.spv ...     names are those of the files
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

// The few instructions and decorations that are looked at (SPIR-V specification, section 3).
enum Op : uint32_t {
    kExecutionMode = 16,
    kTypeInt = 21,
    kTypeFloat = 22,
    kTypeVector = 23,
    kTypeArray = 28,
    kTypeRuntimeArray = 29,
    kTypeStruct = 30,
    kTypePointer = 32,
    kConstant = 43,
    kFunctionCall = 57,
    kVariable = 59,
    kLoad = 61,
    kStore = 62,
    kCopyMemory = 63,
    kAccessChain = 65,
    kInBoundsAccessChain = 66,
    kDecorate = 71,
    kMemberDecorate = 72,
    kCopyObject = 83,
    kAtomicLoad = 227,
    kAtomicStore = 228,
    kAtomicExchange = 229,
    kAtomicXor = 242,
    kExecutionModeId = 331
};
enum Decoration : uint32_t { kArrayStride = 6, kBinding = 33, kOffset = 35 };
enum StorageClass : uint32_t { kWorkgroup = 4, kPushConstant = 9, kStorageBuffer = 12 };
constexpr uint32_t kLocalSize = 17, kLocalSizeId = 38, kMagic = 0x07230203;

struct Type {
    uint32_t op = 0;
    std::vector<uint32_t> operands;
};
struct Use {
    bool reads = false, writes = false;
    uint32_t offset = 0, stride = 0;  ///< of the array at the end; without one: 0, bytes of all
};

class Module {
  public:
    explicit Module(std::vector<uint32_t> words) : words_(std::move(words)) {
        if (words_.size() < 5 || words_[0] != kMagic) throw std::runtime_error("is no SPIR-V");
        for (size_t at = 5; at < words_.size(); at += words_[at] >> 16) {
            const uint32_t count = words_[at] >> 16;
            if (count == 0 || at + count > words_.size()) throw std::runtime_error("is cut short");
            take(words_[at] & 0xffffu, words_.data() + at + 1, count - 1);
        }
        for (const auto& [id, binding] : bindings_) layOut(id, uses_[binding]);
    }
    const std::vector<uint32_t>& words() const { return words_; }
    const std::map<uint32_t, Use>& uses() const { return uses_; }
    uint32_t pushBytes() const {
        return pushVariable_ == 0 ? 0 : sizeOfId(types_.at(typeOf_.at(pushVariable_)).operands[1]);
    }
    uint32_t sharedBytes() const {
        uint32_t bytes = 0;
        for (const uint32_t variable : shared_) bytes += sharedSizeOf(types_.at(typeOf_.at(variable)).operands[1]);
        return bytes;
    }
    uint32_t groupSize(size_t axis) const { return isSizeById_ ? constants_.at(group_.at(axis)) : group_.at(axis); }

  private:
    void take(uint32_t op, const uint32_t* w, uint32_t n) {
        switch (op) {
            case kExecutionMode:
            case kExecutionModeId:
                if (w[1] != (op == kExecutionMode ? kLocalSize : kLocalSizeId)) break;
                isSizeById_ = op == kExecutionModeId;
                group_.assign(w + 2, w + 5);
                break;
            case kDecorate:
                if (w[1] == kBinding) bindings_[w[0]] = w[2];
                if (w[1] == kArrayStride) strides_[w[0]] = w[2];
                break;
            case kMemberDecorate:
                if (w[2] == kOffset) offsets_[w[0]][w[1]] = w[3];
                break;
            case kTypeInt:
            case kTypeFloat:
            case kTypeVector:
            case kTypeArray:
            case kTypeRuntimeArray:
            case kTypeStruct:
            case kTypePointer:
                types_[w[0]] = {op, {w + 1, w + n}};
                break;
            case kConstant:
                constants_[w[1]] = w[2];
                break;
            case kVariable:
                typeOf_[w[1]] = w[0];
                root_[w[1]] = w[1];
                if (w[2] == kPushConstant) pushVariable_ = w[1];
                if (w[2] == kWorkgroup) shared_.push_back(w[1]);
                break;
            case kAccessChain:
            case kInBoundsAccessChain:
            case kCopyObject:
                if (root_.count(w[2]) != 0) root_[w[1]] = root_[w[2]];
                break;
            case kLoad:
                note(w[2], true, false);
                break;
            case kStore:
                note(w[0], false, true);
                break;
            case kCopyMemory:
                note(w[0], false, true);
                note(w[1], true, false);
                break;
            case kFunctionCall:  // what it does with a pointer is not followed
                for (uint32_t i = 3; i < n; ++i) note(w[i], true, true);
                break;
            case kAtomicStore:
                note(w[0], false, true);
                break;
            case kAtomicLoad:
                note(w[2], true, false);
                break;
            default:
                if (op >= kAtomicExchange && op <= kAtomicXor) note(w[2], true, true);
        }
    }
    void note(uint32_t pointer, bool reads, bool writes) {
        const auto root = root_.find(pointer);
        if (root == root_.end()) return;
        const auto binding = bindings_.find(root->second);
        if (binding == bindings_.end()) return;
        Use& use = uses_[binding->second];
        use.reads = use.reads || reads;
        use.writes = use.writes || writes;
    }
    void layOut(uint32_t variable, Use& use) const {
        const uint32_t block = types_.at(typeOf_.at(variable)).operands[1];
        const Type& type = types_.at(block);
        const auto last = static_cast<uint32_t>(type.operands.size() - 1);
        if (types_.at(type.operands[last]).op == kTypeRuntimeArray) {
            use.offset = offsets_.at(block).at(last);
            use.stride = strides_.at(type.operands[last]);
        } else {
            use.stride = sizeOfId(block);
        }
    }
    uint32_t sizeOf(const Type& t) const {
        switch (t.op) {
            case kTypeInt:
            case kTypeFloat:
                return t.operands[0] / 8;
            case kTypeVector:
                return t.operands[1] * sizeOfId(t.operands[0]);
            case kTypePointer:
                return 8;
            default:
                throw std::runtime_error("holds a type that is not laid out");
        }
    }
    uint32_t sizeOfId(uint32_t id) const {
        const Type& t = types_.at(id);
        if (t.op == kTypeArray) return constants_.at(t.operands[1]) * strides_.at(id);
        if (t.op != kTypeStruct) return sizeOf(t);
        uint32_t bytes = 0;
        for (uint32_t m = 0; m < t.operands.size(); ++m)
            bytes = std::max(bytes, offsets_.at(id).at(m) + sizeOfId(t.operands[m]));
        return bytes;
    }
    /// What a workgroup shares is not laid out: as std430 would, in vectors of three 16 bytes each.
    uint32_t sharedSizeOf(uint32_t id) const {
        const Type& t = types_.at(id);
        if (t.op == kTypeArray) return constants_.at(t.operands[1]) * sharedSizeOf(t.operands[0]);
        if (t.op == kTypeStruct) throw std::runtime_error("shares a struct, whose size is not known");
        return t.op == kTypeVector && t.operands[1] == 3 ? 4 * sizeOfId(t.operands[0]) : sizeOf(t);
    }

    std::vector<uint32_t> words_, group_{1, 1, 1}, shared_;
    bool isSizeById_ = false;
    uint32_t pushVariable_ = 0;
    std::map<uint32_t, Type> types_;
    std::map<uint32_t, uint32_t> constants_, strides_, bindings_, typeOf_, root_;
    std::map<uint32_t, std::map<uint32_t, uint32_t>> offsets_;
    std::map<uint32_t, Use> uses_;  ///< by binding
};

std::vector<uint32_t> wordsOf(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    std::vector<uint32_t> words(bytes.size() / 4);
    for (size_t i = 0; i < words.size(); ++i)
        for (size_t b = 0; b < 4; ++b) words[i] |= uint32_t{static_cast<unsigned char>(bytes[4 * i + b])} << (8 * b);
    return words;
}

void write(std::ostream& out, const std::string& name, const Module& m, std::string& table) {
    out << "constexpr uint32_t kCode_" << name << "[] = {";
    for (const uint32_t w : m.words()) out << w << "u,";
    out << "};\n";
    out << "constexpr std::array<BindingUse, " << m.uses().size() << "> kUses_" << name << "{{\n";
    for (const auto& [binding, u] : m.uses())
        out << "    {" << binding << ", " << u.reads << ", " << u.writes << ", " << u.offset << ", " << u.stride
            << "},\n";
    out << "}};\n";
    table += "    {\"" + name + "\", kCode_" + name + ", kUses_" + name + ", {" + std::to_string(m.groupSize(0)) +
             ", " + std::to_string(m.groupSize(1)) + ", " + std::to_string(m.groupSize(2)) + "}, " +
             std::to_string(m.pushBytes()) + ", " + std::to_string(m.sharedBytes()) + "},\n";
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) return 2;
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    std::ofstream out(arguments[0]);
    std::string table;
    for (size_t i = 1; i < arguments.size(); ++i) try {
            write(out, std::filesystem::path(arguments[i]).stem().string(), Module(wordsOf(arguments[i])), table);
        } catch (const std::exception& e) {
            std::fprintf(stderr, "%s: %s\n", arguments[i].c_str(), e.what());
            return 1;
        }
    out << "constexpr Shader kShaders[] = {\n" << table << "};\n";
    return out.flush() ? 0 : 1;
}
