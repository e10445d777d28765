"""The renderer's programs in GLSL: place a vertex by its visual's matrix; light a fragment by sun, room and lamp."""

VERTEX_SHADER = """
#version 330
uniform mat4 view;
uniform mat4 projection;
uniform mat4 parts[48];
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec3 colour;
in vec3 part_layer_label;
invariant gl_Position;
out vec3 v_world;
out vec3 v_normal;
out vec3 v_colour;
out vec3 v_uv;
flat out float v_label;
void main() {
    mat4 placed = parts[int(part_layer_label.x)];
    vec4 world = placed * vec4(position, 1.0);
    v_world = world.xyz;
    v_normal = mat3(placed) * normal;
    v_colour = colour;
    v_uv = vec3(uv, part_layer_label.y);
    v_label = part_layer_label.z;
    gl_Position = projection * (view * world);
}
"""

DEPTH_SHADER = """
#version 330
void main() {}
"""

FRAGMENT_SHADER = """
#version 330
uniform sampler2DArray textures;
uniform vec3 eye;
uniform vec3 sun_direction;
uniform vec3 sun;
uniform vec3 above;
uniform vec3 below;
uniform vec3 lamp_place;
uniform vec3 lamp;
uniform float lamp_reach;
in vec3 v_world;
in vec3 v_normal;
in vec3 v_colour;
in vec3 v_uv;
flat in float v_label;
out vec4 colour;
void main() {
    vec3 n = normalize(v_normal);
    if (dot(n, eye - v_world) < 0.0) n = -n;
    vec3 to_lamp = lamp_place - v_world;
    float squared = dot(to_lamp, to_lamp);
    float facing = max(dot(n, to_lamp), 0.0) * inversesqrt(squared + 1e-6);
    vec3 light = mix(below, above, 0.5 + 0.5 * n.z)
        + sun * max(dot(n, sun_direction), 0.0)
        + lamp * (facing / (1.0 + squared * lamp_reach));
    colour = vec4(v_colour * texture(textures, v_uv).rgb * light, v_label);
}
"""
