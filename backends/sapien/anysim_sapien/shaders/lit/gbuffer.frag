#version 450
// Matte surfaces: the colour times the light that arrives, which is the ambient light and that of each lamp times the
// cosine of its angle to the surface. No shadows, no reflections.

layout(set = 0, binding = 0) uniform CameraBuffer {
  mat4 viewMatrix;
  mat4 projectionMatrix;
  mat4 viewMatrixInverse;
  mat4 projectionMatrixInverse;
  float width;
  float height;
} cameraBuffer;

layout(set = 1, binding = 0) uniform ObjectTransformBuffer {
  mat4 modelMatrix;
} objectTransformBuffer;

layout(set = 1, binding = 1) uniform ObjectDataBuffer {
  uvec4 segmentation;
  float transparency;
  int shadeFlat;
} objectDataBuffer;

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
  DirectionalLight directionalLights[8];
  SpotLight spotLights[1];
  PointLight pointLights[8];
  SpotLight texturedLights[1];
} sceneBuffer;

layout(location = 0) in vec4 seenAt;
layout(location = 1) in vec2 textureAt;
layout(location = 2) in flat uvec4 owner;
layout(location = 3) in vec3 facing;

layout(location = 0) out vec4 outColor;
layout(location = 1) out vec4 outPosition;
layout(location = 2) out uvec4 outSegmentation;

void main() {
  vec3 here = seenAt.xyz;
  vec3 normal = normalize(facing);
  if (dot(normal, here) > 0.0) {
    normal = -normal;
  }
  mat3 turn = mat3(cameraBuffer.viewMatrix);
  vec3 light = sceneBuffer.ambientLight.rgb;
  for (int k = 0; k < 8; ++k) {
    DirectionalLight lamp = sceneBuffer.directionalLights[k];
    if (dot(lamp.emission.rgb, lamp.emission.rgb) > 0.0) {
      light += lamp.emission.rgb * max(0.0, dot(normal, -normalize(turn * lamp.direction.xyz)));
    }
  }
  for (int k = 0; k < 8; ++k) {
    PointLight lamp = sceneBuffer.pointLights[k];
    if (dot(lamp.emission.rgb, lamp.emission.rgb) > 0.0) {
      vec3 away = (cameraBuffer.viewMatrix * vec4(lamp.position.xyz, 1.0)).xyz - here;
      light += lamp.emission.rgb * max(0.0, dot(normal, normalize(away)));
    }
  }
  vec4 base = materialBuffer.baseColor;
  if ((materialBuffer.textureMask & 1) != 0) {
    base = texture(colorTexture, textureAt);
  }
  outColor = vec4(base.rgb * light, 1.0);
  outPosition = seenAt;
  outSegmentation = owner;
}
