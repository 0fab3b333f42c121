#version 450
// Lambert's cosine law, in one pass and without shadows: cheap enough to be compiled and run without a graphics card.

layout(constant_id = 0) const int NUM_DIRECTIONAL_LIGHTS = 0;
layout(constant_id = 1) const int NUM_POINT_LIGHTS = 0;

layout(set = 0, binding = 0) uniform CameraBuffer {
  mat4 viewMatrix;
  mat4 projectionMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrixInverse;
  float width;
  float height;
} cameraBuffer;

layout(set = 2, binding = 0) uniform MaterialBuffer {
  vec4 emission;
  vec4 baseColor;
  float fresnel;
  float roughness;
  float metallic;
  float transmission;
  float ior;
  float transmissionRoughness;
  int textureMask;
  int padding1;
  vec4 textureTransforms[6];
} materialBuffer;

layout(set = 2, binding = 1) uniform sampler2D colorTexture;
layout(set = 2, binding = 2) uniform sampler2D roughnessTexture;
layout(set = 2, binding = 3) uniform sampler2D normalTexture;
layout(set = 2, binding = 4) uniform sampler2D metallicTexture;
layout(set = 2, binding = 5) uniform sampler2D emissionTexture;

struct PointLight {
  vec4 position;
  vec4 emission;
};

struct DirectionalLight {
  vec4 direction;
  vec4 emission;
};

struct SpotLight {
  vec4 position;
  vec4 direction;
  vec4 emission;
};

layout(set = 3, binding = 0) uniform SceneBuffer {
  vec4 ambientLight;
  DirectionalLight directionalLights[3];
  SpotLight spotLights[10];
  PointLight pointLights[10];
  SpotLight texturedLights[1];
} sceneBuffer;

layout(location = 0) in vec4 inPosition;
layout(location = 1) in vec2 inUV;
layout(location = 2) in flat uvec4 inSegmentation;
layout(location = 3) in vec3 inNormal;

layout(location = 0) out vec4 outColor;
layout(location = 1) out vec4 outPosition;
layout(location = 2) out uvec4 outSegmentation;

void main() {
  vec4 albedo = materialBuffer.baseColor;
  if ((materialBuffer.textureMask & 1) != 0) {
    vec4 place = materialBuffer.textureTransforms[0];
    albedo = texture(colorTexture, inUV * place.zw + place.xy);
  }
  vec3 facing = normalize(inNormal);
  facing = dot(facing, inPosition.xyz) > 0 ? -facing : facing;  // a surface is seen, and lit, from both sides
  vec3 light = sceneBuffer.ambientLight.rgb;
  for (int i = 0; i < NUM_DIRECTIONAL_LIGHTS; ++i) {
    vec3 along = normalize(mat3(cameraBuffer.viewMatrix) * sceneBuffer.directionalLights[i].direction.xyz);
    light += max(0.0, dot(facing, -along)) * sceneBuffer.directionalLights[i].emission.rgb;
  }
  for (int i = 0; i < NUM_POINT_LIGHTS; ++i) {
    vec4 lamp = cameraBuffer.viewMatrix * vec4(sceneBuffer.pointLights[i].position.xyz, 1);
    light += max(0.0, dot(facing, normalize(lamp.xyz - inPosition.xyz))) * sceneBuffer.pointLights[i].emission.rgb;
  }
  outColor = vec4(materialBuffer.emission.rgb + albedo.rgb * light, albedo.a);
  outPosition = inPosition;
  outSegmentation = inSegmentation;
}
