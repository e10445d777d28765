"""What `mixing.py` and `batch_of` make of training pictures, for a whole batch at once and where the network learns.

The same steps with the same chances, as operations on tensors of fixed shapes: on a GPU a batch of 128 takes a few ms,
where a processor's core takes as much for a single picture. Chance is drawn first (`draw_chance`); the rest is a pure
function (`mix_batch`), so that it can be compiled. Where it differs from `mixing.py`: at most `DYED` people of a
picture are dressed anew; how bright somebody is, is taken from himself, not from the box about him; patterns repeat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import torch

from training.learning.dataset import FAINT, HIDDEN, MIX, OVERLAY, SHOWS, ZOOM
from training.learning.loss import Truth
from training.learning.mixing import FEWEST, FURNITURE, LARGEST
from training.pictures.labels import HEIGHT, WIDTH
from training.pictures.overlay import pattern_bank
from training.pictures.view_pool import AT, MOST_ROWS, ViewPool

PATTERNS, DYED = 3, 3
_DONOR = 100  # added to the number of an actor who comes from the donor
_BOX = slice(AT["x0"], AT["y1"] + 1)

Chance = dict[str, torch.Tensor]
_Draw = Callable[..., torch.Tensor]


class Mixer:
    """Mixed batches of a pool's views.

    Args:
        pool: of views.
        seed: of all chance.
        compile_it: compile `mix_batch` first; needs what torch.compile needs.
    """

    def __init__(self, pool: ViewPool, seed: int, *, compile_it: bool = False) -> None:
        self._pool = pool
        self._device = pool.rows.device
        self._generator = torch.Generator(self._device).manual_seed(seed)
        self._bank = torch.from_numpy(np.stack(pattern_bank())).to(self._device)
        self._mix = torch.compile(mix_batch, dynamic=False) if compile_it else mix_batch

    def choose(self, count: int, weights: torch.Tensor) -> torch.Tensor:
        """Places of `count` views, each as likely as its weight is large; weights of shape (pool.size,)."""
        return torch.multinomial(weights, count, replacement=True, generator=self._generator)

    def batch(self, places: torch.Tensor, pool: ViewPool | None = None) -> tuple[torch.Tensor, Truth]:
        """Pictures, shape (B, 3, 288, 384), 0 to 1, channels last, and what is in them.

        Args:
            places: of the views in the pool, shape (B,); donors are any.
            pool: another than the mixer's own.
        """
        pool, count = pool or self._pool, len(places)
        donors = torch.randint(pool.size, (count,), device=self._device, generator=self._generator)
        chance = draw_chance(count, len(self._bank), self._device, self._generator)
        view, donor = ((pool.pictures[at], pool.masks[at], pool.rows[at], pool.counts[at]) for at in (places, donors))
        images, rows = self._mix(view, donor, chance, self._bank)
        return images, truth_of(rows)


def truth_of(rows: torch.Tensor) -> Truth:
    """Rows of a batch, shape (B, M, columns of `KEPT`), as the loss wants them; one without a mask's number is none."""
    count, most = rows.shape[:2]
    flat = rows.reshape(count * most, -1)
    x0, y0, x1, y1 = flat[:, _BOX].unbind(1)
    boxes = torch.stack([(x0 + x1) / 2 * WIDTH, (y0 + y1) / 2 * HEIGHT, (x1 - x0) * WIDTH, (y1 - y0) * HEIGHT], dim=1)
    exists = flat[:, AT["mask"]] > 0
    fewest = torch.where(flat[:, AT["distance"]] > 4.0, 150.0, 400.0)
    clear = (flat[:, AT["light"]] > 6.0) & (flat[:, AT["contrast"]] > FAINT)
    asked = (flat[:, AT["pixels"]] > fewest) & (flat[:, AT["seen_of_part"]] > 0.25) & clear & (y1 - y0 > 0.05)
    batch = torch.arange(count, device=rows.device).repeat_interleave(most)
    shown = [((flat[:, AT[name]] - low) / (high - low)).clamp(0.0, 1.0) for name, (low, high) in SHOWS.items()]
    kind = flat[:, AT["kind"]].long()
    sure = torch.where(kind == 0, HIDDEN + (1.0 - HIDDEN) * torch.stack(shown).amin(dim=0), 1.0)
    return Truth(boxes, batch, kind, asked & exists, exists, sure)


def draw_chance(count: int, patterns: int, device: torch.device, generator: torch.Generator) -> Chance:
    """All that is left to chance in a batch of `count` pictures, with a bank of so many patterns."""

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand((count, *shape), device=device, generator=generator)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn((count, *shape), device=device, generator=generator)

    def integers(low: int, high: int, *shape: int) -> torch.Tensor:
        return torch.randint(low, high, (count, *shape), device=device, generator=generator)

    def orders(*shape: int) -> torch.Tensor:
        return uniform(*shape, 3).argsort(-1)

    still = uniform() >= 0.6
    plain = torch.arange(3, device=device).expand(count, 3)
    recolours = torch.exp(normal(1) * 0.15) * (1 + normal(3) * 0.06)
    return {
        "quads": _quads(uniform, normal, integers),
        "quad_on": (uniform(1) < OVERLAY) & (torch.arange(PATTERNS, device=device) < integers(1, PATTERNS + 1, 1)),
        "quad_own": uniform(PATTERNS) < 0.35,
        "quad_tint": uniform(PATTERNS, 3) * (0.2 + 0.8 * uniform(PATTERNS, 1)),
        "quad_pattern": integers(0, patterns, PATTERNS),
        "quad_times": torch.tensor([1, 1, 2, 3], device=device)[integers(0, 4, PATTERNS)],
        "mixed": uniform() < MIX,
        "donor_mirrored": uniform() < 0.5,
        "donor_share": uniform(256),
        "donor_shift": torch.where(uniform() < 0.7, integers(-WIDTH // 2, WIDTH // 2 + 1), 0),
        "donor_gain": torch.where(uniform() < 0.5, torch.exp(normal() * 0.25), 1.0),
        "donor_soft": uniform() < 0.6,
        "dye": torch.where(uniform(2 * MOST_ROWS) < 0.35, uniform(2 * MOST_ROWS), -1.0),
        "dye_half": integers(0, 4, DYED),  # 0 what is above the edge only, 1 what is below it, 2 and 3 all
        "dye_edge": 0.1 + 0.8 * uniform(DYED),
        "dye_kind": uniform(DYED),
        "dye_colour": uniform(DYED, 3) * (0.15 + 0.85 * uniform(DYED, 1)),
        "dye_on_grey": uniform(DYED) < 0.5,
        "dye_tint": 0.3 + 0.7 * uniform(DYED, 3),
        "dye_pattern": integers(0, patterns, DYED),
        "dye_scale": torch.exp(math.log(0.15) * uniform(DYED)),
        "dye_corner": uniform(DYED, 2),
        "dye_order": orders(DYED),
        "dye_gains": torch.exp(normal(DYED, 3) * 0.4),
        "zoomed": uniform() < ZOOM,
        "zoom": 1 + 0.25 * uniform(2),
        "zoom_middle": uniform() * (WIDTH - 1),
        "mirrored": uniform() < 0.5,
        "gains": torch.where(still[:, None], 1.0, recolours),
        "offsets": torch.where(still[:, None], 0.0, normal(3) * 4),
        "order": torch.where((still | (uniform() >= 0.1))[:, None], plain, orders()),
    }


def _quads(uniform: _Draw, normal: _Draw, integers: _Draw) -> torch.Tensor:
    """From a picture's pixels (x, y, 1) to places on patterns, 0 to 1: homographies, shape (B, PATTERNS, 3, 3)."""
    tall = (uniform(PATTERNS) < 0.5)[..., None]
    size = torch.where(
        tall,
        torch.stack([0.05 + 0.25 * uniform(PATTERNS), 0.2 + 0.6 * uniform(PATTERNS)], -1),
        0.1 + 0.8 * uniform(PATTERNS, 2),
    )
    low = -0.3 * size + uniform(PATTERNS, 2) * (1 - 0.4 * size)
    unit = torch.tensor([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], device=size.device)
    corners = low[..., None, :] + unit * size[..., None, :] + normal(PATTERNS, 4, 2) * 0.03
    corners = corners * torch.tensor([WIDTH, HEIGHT], device=size.device)
    turned = (torch.arange(4, device=size.device) + integers(0, 4, PATTERNS, 1)) % 4
    corners = corners.gather(2, turned[..., None].expand(-1, -1, -1, 2))
    return _inverse(_square_to(corners))


def _square_to(corners: torch.Tensor) -> torch.Tensor:
    """The homographies that take the unit square to corners, shape (..., 4, 2).

    Heckbert, "Fundamentals of Texture Mapping and Image Warping" (1989), 2.2.3.
    """
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = (corner.unbind(-1) for corner in corners.unbind(-2))
    sx, sy = x0 - x1 + x2 - x3, y0 - y1 + y2 - y3
    dx1, dx2, dy1, dy2 = x1 - x2, x3 - x2, y1 - y2, y3 - y2
    area = dx1 * dy2 - dx2 * dy1
    area = torch.where(area.abs() < 1e-3, 1e-3, area)
    g, h = (sx * dy2 - dx2 * sy) / area, (dx1 * sy - sx * dy1) / area
    one = torch.ones_like(g)
    rows = [x1 - x0 + g * x1, x3 - x0 + h * x3, x0, y1 - y0 + g * y1, y3 - y0 + h * y3, y0, g, h, one]
    return torch.stack(rows, -1).unflatten(-1, (3, 3))


def _inverse(matrices: torch.Tensor) -> torch.Tensor:
    """Of 3 x 3 matrices, but for a factor (the adjugate), as homographies need no more."""
    a, b, c = matrices.unbind(-2)
    return torch.stack([torch.linalg.cross(b, c), torch.linalg.cross(c, a), torch.linalg.cross(a, b)], -1)


View4 = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]


def mix_batch(
    view: View4, donor: View4, chance: Mapping[str, torch.Tensor], bank: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """A batch of views, mixed with donors.

    Args:
        view: pictures, masks, rows and counts as `ViewPool` has them, of each picture of the batch.
        donor: the same, of what is mixed in.
        chance: what `draw_chance` gave.
        bank: of patterns, uint8, shape (N, side, side, 3).

    Returns:
        Pictures, shape (B, 3, 288, 384), 0 to 1, and rows, shape (B, 2 MOST_ROWS, columns of `KEPT`).
    """
    picture = _repaper(view[0].float(), view[1], chance, bank)
    picture, numbers, rows, before = _mix(picture, view, donor, chance)
    lines, columns = _profiles(numbers, rows[..., AT["mask"]])
    rows = _covered(rows, lines, columns, before, chance["mixed"])
    picture = _disguise(picture, numbers, rows, chance, bank)
    picture, numbers = _zoom(picture, numbers, chance)
    rows = _zoomed(rows, lines.sum(-1), *_profiles(numbers, rows[..., AT["mask"]]), chance)
    order = chance["order"][:, None, None, :].expand_as(picture)
    picture = picture.gather(3, order) * chance["gains"][:, None, None] + chance["offsets"][:, None, None]
    return picture.clamp(0, 255).div(255).permute(0, 3, 1, 2), rows


def _grid(like: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    y = torch.arange(HEIGHT, device=like.device, dtype=torch.float32)[:, None]
    x = torch.arange(WIDTH, device=like.device, dtype=torch.float32)[None, :]
    return x, y


def _sampled(bank: torch.Tensor, which: torch.Tensor, u: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
    """Of pattern `which` (B,) at places in its pixels (B, H, W), between them linearly, repeated beyond its edges."""
    side = bank.shape[1]
    left, top = u.floor(), v.floor()
    along, down = (u - left)[..., None], (v - top)[..., None]
    x0, y0 = left.long().remainder(side), top.long().remainder(side)
    x1, y1 = (x0 + 1).remainder(side), (y0 + 1).remainder(side)
    one = which[:, None, None]
    upper = torch.lerp(bank[one, y0, x0].float(), bank[one, y0, x1].float(), along)
    lower = torch.lerp(bank[one, y1, x0].float(), bank[one, y1, x1].float(), along)
    return torch.lerp(upper, lower, down)


def _repaper(
    picture: torch.Tensor, mask: torch.Tensor, chance: Mapping[str, torch.Tensor], bank: torch.Tensor
) -> torch.Tensor:
    free = (mask == 0) | (mask >= FURNITURE)
    x, y = _grid(picture)
    for k in range(PATTERNS):
        m = chance["quads"][:, k, :, :, None, None]
        depth = m[:, 2, 0] * x + m[:, 2, 1] * y + m[:, 2, 2]
        depth = torch.where(depth.abs() < 1e-6, 1e-6, depth)
        u = (m[:, 0, 0] * x + m[:, 0, 1] * y + m[:, 0, 2]) / depth
        v = (m[:, 1, 0] * x + m[:, 1, 1] * y + m[:, 1, 2]) / depth
        inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1) & free & chance["quad_on"][:, k, None, None]
        scale = (chance["quad_times"][:, k] * bank.shape[1])[:, None, None]
        laid = _sampled(bank, chance["quad_pattern"][:, k], u.clamp(0, 1) * scale, v.clamp(0, 1) * scale)
        own = chance["quad_own"][:, k, None, None, None]
        new = torch.where(own, laid * chance["quad_tint"][:, k, None, None], picture * laid / 255.0)
        picture = torch.where(inside[..., None], new, picture)
    return picture


def _mix(
    picture: torch.Tensor, view: View4, donor: View4, chance: Mapping[str, torch.Tensor]
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """The pictures, the number of the actor at each pixel, rows of both, and how many pixels each had before."""
    count = len(picture)
    values = torch.arange(256, device=picture.device)
    share = torch.where(values >= FURNITURE, 0.3, 0.85)
    chosen = (chance["donor_share"] < share) & (values > 0) & (donor[3] <= LARGEST * HEIGHT * WIDTH)
    chosen = chosen & chance["mixed"][:, None]
    column = torch.arange(WIDTH, device=picture.device)[None] - chance["donor_shift"][:, None]
    inside = (column >= 0) & (column < WIDTH)
    column = torch.where(chance["donor_mirrored"][:, None], WIDTH - 1 - column, column).clamp(0, WIDTH - 1)
    at = column[:, None, :].expand(count, HEIGHT, WIDTH)
    taken = donor[1].gather(2, at)
    there = chosen.gather(1, taken.reshape(count, -1).long()).view_as(taken) & inside[:, None]
    over = donor[0].gather(2, at[..., None].expand(-1, -1, -1, 3)).float()
    over = (over * chance["donor_gain"][:, None, None, None]).clamp(max=255)
    cover = there.float()
    soft = torch.nn.functional.avg_pool2d(cover[:, None], 3, 1, 1)[:, 0] * inside[:, None]
    cover = torch.where(chance["donor_soft"][:, None, None], soft, cover)[..., None]
    picture = torch.lerp(picture, over, cover)
    actor = torch.where(taken < FURNITURE, taken + _DONOR, 0)
    numbers = torch.where(there, actor, torch.where(view[1] < FURNITURE, view[1], 0))
    rows = torch.cat([view[2], donor[2]], dim=1)
    own = rows[..., AT["mask"]].long()
    came = chosen.gather(1, own[:, MOST_ROWS:])
    mine = torch.cat([own[:, :MOST_ROWS], torch.where(came, own[:, MOST_ROWS:] + _DONOR, 0)], dim=1)
    rows = torch.cat([rows[..., : AT["mask"]], mine[..., None].float()], dim=2)
    before = torch.cat([view[3].gather(1, own[:, :MOST_ROWS]), donor[3].gather(1, own[:, MOST_ROWS:])], dim=1)
    return picture, numbers, rows, before


def _profiles(numbers: torch.Tensor, wanted: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Pixels of each wanted number (B, M) in each line (B, M, H), and in each column (B, M, W)."""
    same = numbers[:, None] == wanted[:, :, None, None].to(numbers.dtype)
    return same.sum(3, dtype=torch.int32), same.sum(2, dtype=torch.int32)


def _bounds(lines: torch.Tensor, columns: torch.Tensor) -> torch.Tensor:
    """x0, y0, x1, y1 as shares of the picture, shape (B, M, 4); of what has no pixels it is without meaning."""

    def ends(profile: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        some = (profile > 0).int()
        size = profile.shape[-1]
        return some.argmax(-1) / size, (size - some.flip(-1).argmax(-1)) / size

    (y0, y1), (x0, x1) = ends(lines), ends(columns)
    return torch.stack([x0, y0, x1, y1], dim=-1)


def _covered(
    rows: torch.Tensor, lines: torch.Tensor, columns: torch.Tensor, before: torch.Tensor, mixed: torch.Tensor
) -> torch.Tensor:
    """Rows as those are seen whom what was laid over a view hides in part, or who came with it."""
    now = lines.sum(-1)
    donor = torch.arange(rows.shape[1], device=rows.device) >= MOST_ROWS
    same = ((now == before) & (before > 0) & ~donor) | ~mixed[:, None]
    left = (now.float() / before.clamp(min=1))[..., None]
    there = (rows[..., AT["mask"]] > 0) & (same | (now >= FEWEST))
    box = torch.where(same[..., None], rows[..., _BOX], _bounds(lines, columns))
    whole, part = rows[..., AT["seen_of_whole"], None], rows[..., AT["seen_of_part"], None]
    whole = torch.where(same[..., None], whole, whole * left.clamp(max=1.0))
    part = torch.where((same | donor)[..., None], part, part * left)
    pixels = rows[..., AT["pixels"], None]
    pixels = torch.where(same[..., None], pixels, pixels * left)
    return _put(rows, box, torch.cat([whole, part, pixels], dim=-1), there)


def _put(rows: torch.Tensor, box: torch.Tensor, seen: torch.Tensor, there: torch.Tensor) -> torch.Tensor:
    """Rows with other boxes, and other shares of the whole, of the part and pixels that are seen."""
    kind, distance = rows[..., :1], rows[..., AT["distance"], None]
    rest = rows[..., AT["light"] : AT["mask"]]
    number = (rows[..., AT["mask"]] * there)[..., None]
    return torch.cat([kind, box, distance, seen, rest, number], dim=-1)


def _disguise(
    picture: torch.Tensor,
    numbers: torch.Tensor,
    rows: torch.Tensor,
    chance: Mapping[str, torch.Tensor],
    bank: torch.Tensor,
) -> torch.Tensor:
    is_person = (rows[..., AT["mask"]] > 0) & (rows[..., AT["kind"]] == 0)
    score, which = torch.where(is_person, chance["dye"], -1.0).topk(DYED, dim=1)
    x, y = _grid(picture)
    for k in range(DYED):
        row = rows.gather(1, which[:, k, None, None].expand(-1, 1, rows.shape[2]))[:, 0, :, None, None]
        x0, y0, x1, y1 = (row[:, AT[name]] * scale for name, scale in _EDGES)
        where = (numbers == row[:, AT["mask"]].to(numbers.dtype)) & (score[:, k] >= 0)[:, None, None]
        below = y >= y0 + chance["dye_edge"][:, k, None, None] * (y1 - y0)
        half = chance["dye_half"][:, k, None, None]
        where = where & ((half >= 2) | (below == (half == 1)))
        grey = picture.amax(-1)
        mean = ((grey * where).sum((1, 2)) / where.sum((1, 2)).clamp(min=1))[:, None, None, None]
        level = 255.0 / mean.clamp(min=8.0) * (mean / 128.0).clamp(0.2, 1.0)
        one = grey[..., None] * (chance["dye_colour"][:, k, None, None] * level)
        side = (bank.shape[1] * chance["dye_scale"][:, k]).clamp(min=4.0)
        start = chance["dye_corner"][:, k] * (bank.shape[1] - side)[:, None]
        u = start[:, 0, None, None] + (x - x0) / (x1 - x0).clamp(min=1) * (side[:, None, None] - 1)
        v = start[:, 1, None, None] + (y - y0) / (y1 - y0).clamp(min=1) * (side[:, None, None] - 1)
        laid = _sampled(bank, chance["dye_pattern"][:, k], u, v)
        on_grey = laid * grey[..., None] / 200.0 * chance["dye_tint"][:, k, None, None]
        patterned = torch.where(chance["dye_on_grey"][:, k, None, None, None], on_grey, picture * laid / 255.0)
        order = chance["dye_order"][:, k, None, None, :].expand_as(picture)
        other = picture.gather(3, order) * chance["dye_gains"][:, k, None, None]
        kind = chance["dye_kind"][:, k, None, None, None]
        new = torch.where(kind < 0.35, one, torch.where(kind < 0.7, patterned, other)).clamp(0, 255)
        picture = torch.where(where[..., None], new, picture)
    return picture


_EDGES = (("x0", WIDTH), ("y0", HEIGHT), ("x1", WIDTH), ("y1", HEIGHT))


def _zoom(
    picture: torch.Tensor, numbers: torch.Tensor, chance: Mapping[str, torch.Tensor]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Enlarged about a point of the horizon, and left and right changed, both by chance."""
    count = len(picture)
    factor = torch.where(chance["zoomed"][:, None], chance["zoom"], 1.0)
    x, y = _grid(picture)
    x = torch.where(chance["mirrored"][:, None], WIDTH - 1 - x, x)
    middle = chance["zoom_middle"][:, None]
    x = ((x - middle) / factor[:, :1] + middle).clamp(0, WIDTH - 1)
    centre = (HEIGHT - 1) / 2
    y = ((y[:, 0] - centre) / factor[:, 1:] + centre).clamp(0, HEIGHT - 1)
    x0, y0 = x.floor().long(), y.floor().long()
    x1, y1 = (x0 + 1).clamp(max=WIDTH - 1), (y0 + 1).clamp(max=HEIGHT - 1)
    along, down = (x - x0)[:, None, :, None], (y - y0)[:, :, None, None]
    one = torch.arange(count, device=picture.device)[:, None, None]
    upper = torch.lerp(picture[one, y0[:, :, None], x0[:, None]], picture[one, y0[:, :, None], x1[:, None]], along)
    lower = torch.lerp(picture[one, y1[:, :, None], x0[:, None]], picture[one, y1[:, :, None], x1[:, None]], along)
    nearest = numbers[one, (y + 0.5).floor().long()[:, :, None], (x + 0.5).floor().long()[:, None]]
    return torch.lerp(upper, lower, down), nearest


def _zoomed(
    rows: torch.Tensor,
    before: torch.Tensor,
    lines: torch.Tensor,
    columns: torch.Tensor,
    chance: Mapping[str, torch.Tensor],
) -> torch.Tensor:
    now = lines.sum(-1)
    zoomed = chance["zoomed"][:, None]
    x0, y0, x1, y1 = rows[..., _BOX].unbind(-1)
    flipped = torch.stack([1 - x1, y0, 1 - x0, y1], dim=-1)
    plain = torch.where(chance["mirrored"][:, None, None], flipped, rows[..., _BOX])
    box = torch.where(zoomed[..., None], _bounds(lines, columns), plain)
    left = torch.where(zoomed, now.float() / before.clamp(min=1), 1.0)[..., None]
    larger = torch.where(zoomed, chance["zoom"].prod(dim=1, keepdim=True), 1.0)[..., None]
    whole = rows[..., AT["seen_of_whole"], None] * (left / larger).clamp(max=1.0)
    pixels = rows[..., AT["pixels"], None] * left
    seen = torch.cat([whole, rows[..., AT["seen_of_part"], None], pixels], dim=-1)
    return _put(rows, box, seen, ~zoomed | (now >= FEWEST))
