// For the tests: every field of every shared struct, in the order of its declaration, word by word.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#include "../shared/frame.h"
#include "../shared/material.h"
#include "../shared/mesh.h"
#include "../shared/patch.h"
#include "../shared/record.h"
#include "../shared/curve.h"
#include "../shared/texture.h"
layout(local_size_x = 1) in;
layout(set = 0, binding = 0, scalar) readonly buffer In {
    FrameConstants frame;
    DrawNode node;
    DrawBlock block;
    PointRecord record;
    LightSource light;
    MeshVertex vertex;
    MeshCluster cluster;
    DrawMesh mesh;
    DrawCluster drawCluster;
    SurfaceMaterial material;
    CurveSegment segment;
    TextureInfo textureInfo;
    PatchBlock patchBlock;
};
layout(set = 0, binding = 1, scalar) writeonly buffer Out { uint words[]; };

uint at = 0u;
void put(uint v) { words[at++] = v; }
void put(int v) { put(uint(v)); }
void put(float v) { put(floatBitsToUint(v)); }
void put(vec2 v) {
    put(v.x);
    put(v.y);
}
void put(vec3 v) {
    put(v.x);
    put(v.y);
    put(v.z);
}

void putFrame() {
    put(frame.viewX);
    put(frame.viewY);
    put(frame.viewZ);
    put(frame.focal);
    put(frame.centre);
    put(frame.width);
    put(frame.height);
    put(frame.nearPlane);
    put(frame.supportScale);
    put(frame.minimumRadius);
    put(frame.shade);
    put(frame.debugView);
    put(frame.sunDirection);
    put(frame.skyDirection);
    put(frame.background);
    for (uint k = 0u; k < kKindNothing; ++k) put(frame.firstBlock.of[k]);
    put(frame.lightCount);
    put(frame.ambient);
    put(frame.hasEnvironment);
    put(frame.exactCurves);
    put(frame.coverageSeed);
    put(frame.environmentX);
    put(frame.environmentY);
    put(frame.environmentZ);
    put(frame.orthographic);
    put(frame.lowPass);
    put(frame.kernelSupport);
    put(frame.perSurfel);
    put(frame.hasMaterials);
    put(frame.patchAs);
    put(frame.environmentSharp);
    put(frame.shadowMaps);
    put(frame.shadowSlots);
}

void putNode() {
    put(node.axisX);
    put(node.axisY);
    put(node.axisZ);
    put(node.base);
    put(node.edge);
    put(node.errorCode);
    put(node.octantMask);
    put(node.count);
    put(node.addressLow);
    put(node.addressHigh);
    put(node.level);
    put(node.errorPixels);
    put(node.spacing);
    put(node.weights);
    put(node.material);
    put(node.materials);
}

void putBlock() {
    put(block.node);
    put(block.first);
}

void putRecord() {
    put(record.positionXY);
    put(record.positionZRadiusError);
    put(record.normal);
    put(record.colour);
}

void putLight() {
    put(light.position);
    put(light.kind);
    put(light.colour);
    put(light.range);
    put(light.axis);
    put(light.cosInner);
    put(light.cosOuter);
    put(light.shadow);
}

void putVertex() {
    put(vertex.x);
    put(vertex.y);
    put(vertex.z);
    put(vertex.normal);
    put(vertex.colour);
    put(vertex.u);
    put(vertex.v);
    put(vertex.surface);
}

void putCluster() {
    put(cluster.firstVertex);
    put(cluster.firstTriangle);
    put(cluster.counts);
}

void putMesh() {
    put(mesh.axisX);
    put(mesh.axisY);
    put(mesh.axisZ);
    put(mesh.base);
    put(mesh.normalX);
    put(mesh.normalY);
    put(mesh.normalZ);
    put(mesh.eyeX);
    put(mesh.eyeY);
    put(mesh.eyeZ);
    put(mesh.eyeHighX);
    put(mesh.eyeHighY);
    put(mesh.eyeHighZ);
    put(mesh.places);
    put(mesh.firstMaterial);
    put(mesh.mirror);
}

void putDrawCluster() {
    put(drawCluster.mesh);
    put(drawCluster.counts);
    put(drawCluster.verticesLow);
    put(drawCluster.verticesHigh);
    put(drawCluster.trianglesLow);
    put(drawCluster.trianglesHigh);
    put(drawCluster.firstTexture);
    put(drawCluster.firstTile);
    put(drawCluster.level);
    put(drawCluster.errorPixels);
}

void putMaterial() {
    put(material.baseColour);
    put(material.alphaCutoff);
    put(material.emissive);
    put(material.metallic);
    put(material.roughness);
    put(material.normalScale);
    put(material.occlusionStrength);
    put(material.alpha);
    put(material.baseTexture.texture);
    put(material.baseTexture.rowU);
    put(material.baseTexture.rowV);
    put(material.surfaceTexture.texture);
    put(material.surfaceTexture.rowU);
    put(material.surfaceTexture.rowV);
    put(material.normalTexture.texture);
    put(material.normalTexture.rowU);
    put(material.normalTexture.rowV);
    put(material.occlusionTexture.texture);
    put(material.occlusionTexture.rowU);
    put(material.occlusionTexture.rowV);
    put(material.emissiveTexture.texture);
    put(material.emissiveTexture.rowU);
    put(material.emissiveTexture.rowV);
    put(material.optics);
}

void putSegment() {
    put(segment.a.positionXY);
    put(segment.a.positionZ);
    put(segment.a.direction);
    put(segment.a.colour);
    put(segment.b.positionXY);
    put(segment.b.positionZ);
    put(segment.b.direction);
    put(segment.b.colour);
}

void putTextureInfo() {
    put(textureInfo.width);
    put(textureInfo.height);
    put(textureInfo.levels);
    put(textureInfo.wrapU);
    put(textureInfo.wrapV);
    put(textureInfo.isColour);
    for (uint i = 0u; i < kTextureLevels; ++i) put(textureInfo.firstTile[i]);
}

void putPatchBlock() {
    put(patchBlock.number);
    put(patchBlock.place);
    put(patchBlock.map);
    for (uint k = 0u; k < 4u; ++k) put(patchBlock.cells[k]);
    for (uint k = 0u; k < kPatchSamples; ++k) put(patchBlock.normals[k]);
    for (uint k = 0u; k < kPatchSamples; ++k) put(patchBlock.colours[k]);
    for (uint k = 0u; k < (kPatchSamples + 1u) / 2u; ++k) put(patchBlock.heights[k]);
}

void main() {
    putFrame();
    putNode();
    putBlock();
    putRecord();
    putLight();
    putVertex();
    putCluster();
    putMesh();
    putDrawCluster();
    putMaterial();
    putSegment();
    putTextureInfo();
    putPatchBlock();
}
