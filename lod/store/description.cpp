#include "lod/store/description.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "engine/base/text.h"

namespace stipple::lod {
namespace {

using nlohmann::json;

/// A whole number that T holds: others have no value in it, not even a wrong one.
template <typename T>
T whole(const json& j) {
    const bool fits = j.is_number_unsigned() ? std::in_range<T>(j.get<uint64_t>())
                                             : j.is_number_integer() && std::in_range<T>(j.get<int64_t>());
    if (!fits) throw std::runtime_error("a whole number is none");
    return j.get<T>();
}
float real(const json& j) {
    const double value = j.get<double>();
    if (!(std::abs(value) <= std::numeric_limits<float>::max())) throw std::runtime_error("a number is too large");
    return static_cast<float>(value);
}
float share(const json& j) {
    const float value = real(j);
    if (!(value >= 0 && value <= 1)) throw std::runtime_error("a share is not between 0 and 1");
    return value;
}
std::map<std::string, uint64_t> countsFromJson(const json& j, const char* name) {
    std::map<std::string, uint64_t> out;
    if (j.contains(name))
        for (const auto& [reason, count] : j.at(name).items()) out[reason] = whole<uint64_t>(count);
    return out;
}

json toJson(const glm::vec3& v) { return {v.x, v.y, v.z}; }
shared::vec3 vectorFromJson(const json& j) { return {real(j.at(0)), real(j.at(1)), real(j.at(2))}; }
json toJson(const shared::TextureSlot& s) {
    return {{"texture", s.texture}, {"u", toJson(s.rowU)}, {"v", toJson(s.rowV)}};
}
shared::TextureSlot slotFromJson(const json& j) {
    return {whole<uint32_t>(j.at("texture")), vectorFromJson(j.at("u")), vectorFromJson(j.at("v"))};
}

json opticsToJson(const Optics& o) {
    json out = {{"transmission", o.transmission},
                {"ior", o.ior},
                {"thickness", o.thickness},
                {"attenuation_distance", o.attenuationDistance},
                {"attenuation_colour", toJson(o.attenuationColour)},
                {"specular", o.specular},
                {"specular_colour", toJson(o.specularColour)}};
    if (o.blends) out["blends"] = o.opacity;
    return out;
}

Optics opticsFromJson(const json& j) {
    Optics o;
    o.transmission = real(j.at("transmission"));
    o.ior = real(j.at("ior"));
    o.thickness = real(j.at("thickness"));
    o.attenuationDistance = real(j.at("attenuation_distance"));
    o.attenuationColour = vectorFromJson(j.at("attenuation_colour"));
    o.specular = real(j.at("specular"));
    o.specularColour = vectorFromJson(j.at("specular_colour"));
    o.blends = j.contains("blends");
    if (o.blends) o.opacity = real(j.at("blends"));
    if (!o.isPossible()) throw std::runtime_error("optics of a material are not possible");
    return o;
}

json materialToJson(const shared::SurfaceMaterial& m) {
    return {{"base_colour", toJson(m.baseColour)},
            {"alpha", m.alpha},
            {"alpha_cutoff", m.alphaCutoff},
            {"emissive", toJson(m.emissive)},
            {"metallic", m.metallic},
            {"roughness", m.roughness},
            {"normal_scale", m.normalScale},
            {"occlusion_strength", m.occlusionStrength},
            {"base_texture", toJson(m.baseTexture)},
            {"surface_texture", toJson(m.surfaceTexture)},
            {"normal_texture", toJson(m.normalTexture)},
            {"occlusion_texture", toJson(m.occlusionTexture)},
            {"emissive_texture", toJson(m.emissiveTexture)}};
}

shared::SurfaceMaterial materialFromJson(const json& j) {
    shared::SurfaceMaterial m{};
    m.baseColour = vectorFromJson(j.at("base_colour"));
    m.alpha = real(j.at("alpha"));
    m.alphaCutoff = real(j.at("alpha_cutoff"));
    m.emissive = vectorFromJson(j.at("emissive"));
    m.metallic = real(j.at("metallic"));
    m.roughness = real(j.at("roughness"));
    m.normalScale = real(j.at("normal_scale"));
    m.occlusionStrength = real(j.at("occlusion_strength"));
    m.baseTexture = slotFromJson(j.at("base_texture"));
    m.surfaceTexture = slotFromJson(j.at("surface_texture"));
    m.normalTexture = slotFromJson(j.at("normal_texture"));
    m.occlusionTexture = slotFromJson(j.at("occlusion_texture"));
    m.emissiveTexture = slotFromJson(j.at("emissive_texture"));
    return m;
}

json toJson(const StoreDescription& d) {
    json attributes = json::array();
    for (const AttributeInfo& a : d.attributes) {
        attributes.push_back({{"name", toUtf8(a.name)},
                              {"type", kScalarNames.at(static_cast<size_t>(a.type))},
                              {"aggregate", kAggregateNames.at(static_cast<size_t>(a.aggregate))},
                              {"scale", a.scale},
                              {"offset", a.offset},
                              {"description", toUtf8(a.description)},
                              {"least", a.least},
                              {"greatest", a.greatest},
                              {"low", a.low},
                              {"high", a.high},
                              {"counts", a.counts}});
        if (a.noData) attributes.back()["no_data"] = *a.noData;
        if (a.withoutData > 0) attributes.back()["without_data"] = a.withoutData;
    }
    json materials = json::array();
    for (const shared::SurfaceMaterial& m : d.materials) materials.push_back(materialToJson(m));
    json out = {{"metres_per_unit", d.metresPerUnit},
                {"up", {d.up.x, d.up.y, d.up.z}},
                {"crs",
                 {{"name", toUtf8(d.crs.name)},
                  {"epsg", d.crs.epsg},
                  {"text", toUtf8(d.crs.text)},
                  {"is_degrees", d.crs.isDegrees}}},
                {"attributes", attributes},
                {"low_height", d.lowHeight},
                {"high_height", d.highHeight},
                {"points", d.points},
                {"records", d.records},
                {"rounding", d.roundingUnits},
                {"min", {d.boundsMin.x, d.boundsMin.y, d.boundsMin.z}},
                {"max", {d.boundsMax.x, d.boundsMax.y, d.boundsMax.z}},
                {"focus_min", {d.focusMin.x, d.focusMin.y, d.focusMin.z}},
                {"focus_max", {d.focusMax.x, d.focusMax.y, d.focusMax.z}},
                {"has_colour", d.hasColour},
                {"is_reflectance", d.isReflectance},
                {"is_strands", d.isCurves},  // as files have named it from the first
                {"is_progressive", d.isStochastic},
                {"disc_factors", d.discFactors},
                {"smallest_disc", d.smallestDisc},
                {"has_normals", d.hasNormals},
                {"materials", materials},
                {"points_in", d.pointsIn},
                {"dropped", d.dropped},
                {"added", d.added},
                {"source", toUtf8(d.source)}};
    if (d.isRigid) out["is_rigid"] = true;
    if (const PatchCounts& p = d.patches; p.patches + p.discs > 0)
        out["patches"] = {{"patches", p.patches}, {"samples", p.samples}, {"left", p.left}, {"discs", p.discs}};
    for (const Optics& o : d.optics) out["optics"].push_back(opticsToJson(o));
    for (const PointMaterial& m : d.pointMaterials) {
        json material = {m.roughness, m.metallic};
        if (m.optics != Optics{}) material.push_back(opticsToJson(m.optics));
        out["point_materials"].push_back(std::move(material));
    }
    return out;
}

template <size_t N>
size_t indexOf(const std::array<const char*, N>& names, const std::string& name) {
    for (size_t i = 0; i < N; ++i)
        if (name == names.at(i)) return i;
    throw std::runtime_error("unknown name '" + name + "'");
}

AttributeInfo attributeFromJson(const json& j) {
    AttributeInfo a;
    a.name = j.at("name").get<std::string>();
    a.type = static_cast<ScalarType>(indexOf(kScalarNames, j.at("type").get<std::string>()));
    a.aggregate = static_cast<Aggregate>(indexOf(kAggregateNames, j.at("aggregate").get<std::string>()));
    a.scale = j.at("scale").get<double>();
    a.offset = j.at("offset").get<double>();
    a.description = j.at("description").get<std::string>();
    a.least = j.at("least").get<double>();
    a.greatest = j.at("greatest").get<double>();
    a.low = j.at("low").get<double>();
    a.high = j.at("high").get<double>();
    if (j.contains("no_data")) a.noData = j["no_data"].get<double>();
    if (j.contains("without_data")) a.withoutData = whole<uint64_t>(j["without_data"]);
    for (const json& c : j.at("counts")) a.counts.emplace_back(c.at(0).get<double>(), whole<uint64_t>(c.at(1)));
    return a;
}

StoreDescription fromJson(const json& j) {
    StoreDescription d;
    d.metresPerUnit = j.at("metres_per_unit").get<double>();
    const json& crs = j.at("crs");
    d.crs.name = crs.at("name").get<std::string>();
    d.crs.epsg = whole<int>(crs.at("epsg"));
    d.crs.text = crs.at("text").get<std::string>();
    d.crs.isDegrees = crs.at("is_degrees").get<bool>();
    d.crs.metresPerUnit = d.metresPerUnit;
    for (const json& a : j.at("attributes")) d.attributes.push_back(attributeFromJson(a));
    d.lowHeight = j.at("low_height").get<double>();
    d.highHeight = j.at("high_height").get<double>();
    d.points = whole<uint64_t>(j.at("points"));
    d.records = whole<uint64_t>(j.at("records"));
    d.roundingUnits = j.at("rounding").get<double>();
    for (int i = 0; i < 3; ++i) {
        d.boundsMin[i] = j.at("min").at(static_cast<size_t>(i)).get<double>();
        d.focusMin[i] = j.at("focus_min").at(static_cast<size_t>(i)).get<double>();
        d.focusMax[i] = j.at("focus_max").at(static_cast<size_t>(i)).get<double>();
        d.up[i] = j.at("up").at(static_cast<size_t>(i)).get<double>();
        d.boundsMax[i] = j.at("max").at(static_cast<size_t>(i)).get<double>();
    }
    d.hasColour = j.at("has_colour").get<bool>();
    d.isReflectance = j.at("is_reflectance").get<bool>();
    d.isCurves = j.at("is_strands").get<bool>();
    d.isRigid = j.value("is_rigid", false);
    if (j.contains("patches")) {
        const json& p = j["patches"];
        d.patches = {whole<uint64_t>(p.at("patches")), whole<uint64_t>(p.at("samples")), whole<uint64_t>(p.at("left")),
                     whole<uint64_t>(p.at("discs"))};
    }
    d.isStochastic = j.at("is_progressive").get<bool>();
    for (const json& factor : j.at("disc_factors")) d.discFactors.push_back(real(factor));
    d.smallestDisc = j.at("smallest_disc").get<double>();
    d.hasNormals = j.at("has_normals").get<bool>();
    d.source = j.at("source").get<std::string>();
    d.pointsIn = j.contains("points_in") ? whole<uint64_t>(j.at("points_in")) : 0;
    d.dropped = countsFromJson(j, "dropped");
    d.added = countsFromJson(j, "added");
    for (const json& m : j.at("materials")) d.materials.push_back(materialFromJson(m));
    if (j.contains("optics"))
        for (const json& o : j.at("optics")) d.optics.push_back(opticsFromJson(o));
    if (!d.optics.empty() && d.optics.size() != d.materials.size())
        throw std::runtime_error("not every material has optics");
    if (j.contains("point_materials"))
        for (const json& m : j.at("point_materials"))
            d.pointMaterials.push_back(
                {share(m.at(0)), share(m.at(1)), m.size() > 2 ? opticsFromJson(m.at(2)) : Optics{}});
    if (d.pointMaterials.size() > kMostPointMaterials) throw std::runtime_error("it has too many materials of points");
    return d;
}

}  // namespace

std::string describeAsText(const StoreDescription& description) { return toJson(description).dump(); }
StoreDescription descriptionFromText(const std::string& text) {
    // As many values as 65,536 materials have, and no deeper than they stand: text that is nothing but brackets takes
    // a hundred times its size.
    constexpr uint64_t kMostValues = 8'000'000;
    constexpr int kDeepest = 16;
    uint64_t values = 0;
    return fromJson(json::parse(text, [&](int depth, json::parse_event_t, json&) {
        if (++values > kMostValues || depth > kDeepest) throw std::runtime_error("it holds too much");
        return true;
    }));
}

}  // namespace stipple::lod
