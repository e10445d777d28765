"""The renderer's programs in GLSL: place a vertex by its visual's matrix, light it, and shade the fragments.

Sun and room light the vertices; a lamp, if there is one, lights each fragment, because a wall has only four vertices.
"""

_VERTEX = """
uniform mat4 view;
uniform mat4 projection;
uniform mat4 parts[48];
uniform vec3 eye;
uniform vec3 sun_direction;
uniform vec3 sun;
uniform vec3 above;
uniform vec3 below;
in vec3 position;
in vec3 normal;
in vec3 colour;
in vec3 part_layer_label;
#ifdef JOINTED
in vec2 partner;
#endif
out vec3 v_colour;
out vec3 v_light;
flat out float v_label;
#ifdef TEXTURED
in vec2 uv;
out vec3 v_uv;
#endif
#ifdef LAMP
out vec3 v_world;
out vec3 v_normal;
#endif
void main() {
    mat4 placed = parts[int(part_layer_label.x)];
#ifdef JOINTED
    placed = placed * (1.0 - partner.y) + parts[int(partner.x)] * partner.y;
#endif
    vec4 world = placed * vec4(position, 1.0);
    gl_Position = projection * (view * world);
    vec3 n = normalize(mat3(placed) * normal);
    if (dot(n, eye - world.xyz) < 0.0) n = -n;
    v_light = mix(below, above, 0.5 + 0.5 * n.z) + sun * max(dot(n, sun_direction), 0.0);
    v_colour = colour;
    v_label = part_layer_label.z;
#ifdef TEXTURED
    v_uv = vec3(uv, part_layer_label.y);
#endif
#ifdef LAMP
    v_world = world.xyz;
    v_normal = n;
#endif
}
"""

_FRAGMENT = """
in vec3 v_colour;
in vec3 v_light;
flat in float v_label;
out vec4 fragment;
#ifdef TEXTURED
uniform sampler2DArray textures;
in vec3 v_uv;
#endif
#ifdef LAMP
uniform vec3 lamp_place;
uniform vec3 lamp;
uniform float lamp_reach;
in vec3 v_world;
in vec3 v_normal;
#endif
void main() {
    vec3 light = v_light;
#ifdef LAMP
    vec3 to_lamp = lamp_place - v_world;
    float squared = dot(to_lamp, to_lamp);
    float facing = max(dot(v_normal, to_lamp), 0.0) * inversesqrt(squared * dot(v_normal, v_normal) + 1e-6);
    light += lamp * (facing / (1.0 + squared * lamp_reach));
#endif
#ifdef TEXTURED
    light *= texture(textures, v_uv).rgb;
#endif
    fragment = vec4(v_colour * light, v_label);
}
"""


def sources(*, lamp: bool, textured: bool, jointed: bool) -> tuple[str, str]:
    """Vertex and fragment program with or without a lamp, textures, and vertices that follow two parts."""
    kinds = {"LAMP": lamp, "TEXTURED": textured, "JOINTED": jointed}
    head = "#version 330\n" + "".join(f"#define {name}\n" for name, wanted in kinds.items() if wanted)
    return head + _VERTEX, head + _FRAGMENT
