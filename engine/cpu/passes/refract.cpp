// A layer of glass, pixel by pixel (shaders/shared/optics.h): what it reflects and what is seen through it.
#include "engine/cpu/passes/passes.h"
#include "engine/render/layers.h"
#include "shaders/shared/optics.h"
#include "shaders/shared/pack.h"
#include "shaders/shared/surface.h"

namespace stipple::cpu {
namespace {

using namespace shared;

struct GlassRow {
    const FrameConstants& f;
    const render::LayerTables& tables;
    std::span<const LightSource> lights;
    SeenTables seen;

    /// What lights of the scene's own, or the sun, send back.
    vec3 lightsOn(const Surface& s, vec3 point) const {
        vec3 sum(0, 0, 0);
        if (lights.empty() && f.hasEnvironment == 0) return reflectLight(s, f.sunDirection, vec3(0.75f, 0.75f, 0.75f));
        for (const LightSource& light : lights) {
            const bool isFar = light.kind == kLightDirectional;
            const vec3 to(light.position.x - (isFar ? 0.0f : point.x), light.position.y - (isFar ? 0.0f : point.y),
                          light.position.z - (isFar ? 0.0f : point.z));
            const vec3 l = scaled(to, 1.0f / std::sqrt(max(dot(to, to), 1.0e-12f)));
            sum = addScaled(sum, reflectLight(s, l, light.colour), lightAt(light, point, point.z));
        }
        return sum;
    }
    void shade(SurfaceRow& row, size_t i, PixelRay ray) const {
        const uint32_t word = row.material[i];
        const bool isTriangle = (word & kPixelTriangle) != 0;
        const uint32_t own = isTriangle ? (word & kPixelOptics) >> kPixelOpticsShift : 0u;
        const uint32_t number = own != 0 ? own : tables.constants.pointOptic;
        if (number == 0) return;  // opaque: what is behind shows it
        const Optic o = tables.optics[own == kPixelBlends >> kPixelOpticsShift ? 0u : number];
        Surface s;
        s.colour = vec3(row.red[i], row.green[i], row.blue[i]);
        s.normal = vec3(row.nx[i], row.ny[i], row.nz[i]);
        const vec3 d = rayDirection(ray);
        s.toEye = scaled(d, -1.0f / std::sqrt(dot(d, d)));
        s.metallic = float(int(word & 255u)) * (1.0f / 255.0f);
        s.roughness = float(int(word >> 8 & 255u)) * (1.0f / 255.0f);
        if (own == 0 && (word & kPixelMaterial) == 0) s.roughness = tables.constants.plainRoughness;
        s.occlusion = wordOcclusion(word);
        s.leaf = 0;
        s.dielectric = o.straightOn;
        const vec3 point = alongRay(ray, row.depth[i]);
        const vec3 lit = opticLight(seen, f, tables.constants, o, s, point, lightsOn(opaqueShare(s, o), point));
        row.red[i] = lit.x;
        row.green[i] = lit.y;
        row.blue[i] = lit.z;
        if (!row.hasEmission) return;
        row.red[i] += unpackRed(row.emission[i]);
        row.green[i] += unpackGreen(row.emission[i]);
        row.blue[i] += unpackBlue(row.emission[i]);
    }
};

void run(const RowPlace& at, SurfaceRow& row) {
    const render::DrawList& draws = *at.frame.draws;
    const FrameConstants& f = at.frame.constants;
    const render::LayerTables& tables = *draws.glass;
    const GlassRow glass{
        f,
        tables,
        draws.lights,
        {draws.environment ? draws.environment->table.data() : nullptr, tables.behind.data(), tables.back.data()}};
    const Lens lens = frameLens(f);
    const float inverseFocal = 1.0f / f.focal, vy = (float(int(at.y)) + 0.5f - f.centre.y) * inverseFocal;
    for (size_t i = 0; i < at.n; ++i) {
        if (!(row.depth[i] > 0.0f)) continue;
        const float vx = (float(int(at.x0 + i)) + 0.5f - f.centre.x) * inverseFocal;
        glass.shade(row, i, pixelRay(lens, vx, vy));
    }
}

}  // namespace

constinit const CpuPass refractPass{
    .row = {.concerns = nullptr,
            .wants = [](const Frame&, SurfaceWants& wants) { wants.normal = wants.depth = true; },
            .run = run}};

}  // namespace stipple::cpu
