#version 450
// Places a vertex, and hands its place and its normal in the world to the fragment shader.
// The names and the order of the members of the uniform blocks are those that SAPIEN fills.

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

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 tangent;
layout(location = 4) in vec3 bitangent;

layout(location = 0) out vec4 seenAt;
layout(location = 1) out vec2 textureAt;
layout(location = 2) out flat uvec4 owner;
layout(location = 3) out vec3 facing;

void main() {
  mat4 toCamera = cameraBuffer.viewMatrix * objectTransformBuffer.modelMatrix;
  seenAt = toCamera * vec4(position, 1.0);
  facing = mat3(transpose(inverse(toCamera))) * normal;
  textureAt = uv;
  owner = objectDataBuffer.segmentation;
  gl_Position = cameraBuffer.projectionMatrix * seenAt;
}
