"""How bright what a ray meets is: by the ring light, by the room, by the laser."""

import numpy as np

from ray_traced.light import send_back, sky_share
from ray_traced.marks import mark
from ray_traced.plate import FACE, VOID, WALL, open_way
from ray_traced.surface import TEXEL, look_up, make_skin

COARSE, FINE = 1.0, 0.15  # mm: the grid of light on a face, free and behind another sheet
BEAM = 6.0                # standard deviations of the laser that are looked at


class Shading:
    """The lights and skins of a scene, ready to shade what rays meet."""

    def __init__(self, scene, rays, hits):
        self.scene, self.eye = scene, rays.eye
        self.ring = scene.ring.turned(scene.turn, scene.centre)
        self.side = scene.side.turned(scene.turn, scene.centre)
        self.fan = scene.fan and scene.fan.turned(scene.turn, scene.centre)
        self.faces = [self._face(number, rays, hits) for number in range(len(scene.sheets))]

    def _face(self, number, rays, hits):
        which, kinds, _ = hits
        mine = np.flatnonzero((which == number) & (kinds != VOID))
        if not len(mine):
            return None
        sheet = self.scene.sheets[number]
        p = rays[mine].at(sheet.front)
        rng = np.random.default_rng([self.scene.seed, number])
        skin = make_skin(rng, sheet.skin.finish, p.min(axis=0) - 0.2, p.max(axis=0) + 0.2)
        mark(rng, skin, sheet.skin.marks)
        return Face(self, number, skin)

    def before(self, number):
        """Give the sheets that may stand in the light of this one."""
        return self.scene.sheets[:number]

    def lit(self, points, normals, lamps, lobe, sheets):
        """Sum matt and glossy light (n,) of lamps at points (n, 3), past sheets."""
        total = np.zeros((2, len(points)))
        for source in lamps.places:
            free = open_way(sheets, points, source)
            total += lamps.strength * free * np.array(
                send_back(points, normals, source, self.eye, lobe))
        return total

    def radiance(self, rays, hits):
        """Shade rays: radiance (n, 3) by ring, room and laser."""
        which, kinds, depths = hits
        light = np.zeros((len(kinds), 3))
        for number, face in enumerate(self.faces):
            if face is None:  # too little of it to be met by a first ray
                continue
            flat = np.flatnonzero((which == number) & (kinds == FACE))
            if len(flat):
                light[flat] = face.shade_flat(rays[flat].at(face.sheet.front))
            bent = np.flatnonzero((which == number) & (kinds > FACE))
            if len(bent):
                points = np.column_stack([rays[bent].at(depths[bent]), depths[bent]])
                light[bent] = face.shade_bent(points, kinds[bent])
        return light


class Face:
    """One sheet's skin under the scene's lights."""

    def __init__(self, shading, number, skin):
        self.shading, self.skin = shading, skin
        self.sheet, self.before = shading.scene.sheets[number], shading.before(number)
        self.step = FINE if self.before else COARSE
        self.maps = [self._map(lamps) for lamps in (shading.ring, shading.side)]
        self.sky = sky_share(self._grid(), self.before).astype(np.float32).reshape(self.shape)

    @property
    def shape(self):
        high, wide = np.array(self.skin.matt.shape) * TEXEL / self.step
        return int(high) + 3, int(wide) + 3

    def _grid(self):
        y, x = np.mgrid[:self.shape[0], :self.shape[1]] * self.step
        return np.column_stack([x.ravel() + self.skin.corner[0], y.ravel() + self.skin.corner[1],
                                np.full(x.size, self.sheet.front)])

    def _map(self, lamps):
        """Give matt and glossy light on the face as maps, and the gloss of each facet."""
        points, upwards = self._grid(), np.array([0.0, 0.0, -1.0])
        lit = self.shading.lit(points, np.tile(upwards, (len(points), 1)), lamps, self.skin.lobe,
                               self.before)
        matt, gloss = lit.astype(np.float32).reshape(2, *self.shape)
        facets = None
        if self.skin.labels is not None:
            seeds = np.column_stack([self.skin.seeds, np.full(len(self.skin.seeds),
                                                              self.sheet.front)])
            facets = self.shading.lit(seeds, self._facet_normals(slice(None)), lamps,
                                      self.skin.lobe, self.before)[1]
        return matt, gloss, facets

    def _facet_normals(self, which):
        tilts = self.skin.tilts[which]
        normals = np.column_stack([tilts, np.full(len(tilts), -1.0)])
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def shade_flat(self, p):
        """Shade points p (n, 2) of the flat face: radiance (n, 3)."""
        matt, gloss = self.skin.albedo(p)
        where = (p - self.skin.corner) / self.step
        light = np.zeros((len(p), 3))
        labels = None if self.skin.labels is None else self.skin.facet_at(p)
        for column, (matt_map, gloss_map, facets) in enumerate(self.maps):
            shine = look_up(gloss_map, where) if facets is None else facets[labels]
            light[:, column] = matt * look_up(matt_map, where) + gloss * shine
        light[:, 1] += self.shading.scene.sky * (matt + gloss) / np.pi * look_up(self.sky, where)
        light[:, 2] = self._laser(np.column_stack([p, np.full(len(p), self.sheet.front)]),
                                  None, matt, gloss, labels)
        return light

    def shade_bent(self, points, kinds):
        """Shade points (n, 3) of rim and wall: radiance (n, 3)."""
        normals = self.sheet.normals(kinds, points)
        wall = kinds == WALL
        share = np.where(wall, self.skin.finish.wall, 1.0)
        matt, gloss = (share * part for part in self.skin.albedo(points[:, :2]))
        light = np.zeros((len(points), 3))
        for column, lamps in enumerate((self.shading.ring, self.shading.side)):
            for part in (wall, ~wall):
                sheets = (*self.before, self.sheet) if part is wall else self.before
                lit = self.shading.lit(points[part], normals[part], lamps, self.skin.lobe, sheets)
                light[part, column] = matt[part] * lit[0] + gloss[part] * lit[1]
        sky = np.where(wall, self._sky_in_bore(points), sky_share(points, self.before))
        light[:, 1] += self.shading.scene.sky * (matt + gloss) / np.pi * sky
        light[:, 2] = self._laser(points, normals, matt, gloss, None)
        return light

    def _sky_in_bore(self, points):
        radius = getattr(self.sheet.openings[0], "radius", 5.0)
        h = np.maximum(points[:, 2] - self.sheet.front, 0.0) / radius
        return (h * h + 2.0) / (2.0 * np.sqrt(h * h + 4.0)) - h / 2.0

    def _laser(self, points, normals, matt, gloss, labels):
        light = np.zeros(len(points))
        fan = self.shading.fan
        if fan is None:
            return light
        near = np.flatnonzero(np.abs(points @ fan.normal + fan.offset) < BEAM * fan.thickness)
        points = points[near]
        if normals is not None:
            normals = normals[near]
        elif labels is not None:
            normals = self._facet_normals(labels[near])
        else:
            normals = np.tile([0.0, 0.0, -1.0], (len(near), 1))
        sent = send_back(points, normals, fan.source, self.shading.eye, self.skin.lobe)
        free = open_way((*self.before, self.sheet), points, fan.source)
        light[near] = free * fan.intensity(points) * (matt[near] * sent[0] + gloss[near] * sent[1])
        return light
