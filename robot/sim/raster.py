"""The inner loops of the rasteriser (numba): project, rasterise, shade.

Visibility buffer with deferred shading. Each pixel has four samples in a rotated grid whose
columns shift from row to row, so that neither vertical nor horizontal edges snap to whole pixels.
Attributes are planes over the screen: for camera-space corners p_k and a viewing ray d, the g
with g . p_k = f_k gives f / z = g . d, exactly, without clipping (Olano and Greer, "Triangle scan
conversion using 2D homogeneous coordinates", 1997).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

NEAR_M = 0.01
SAMPLES = 4
PLANES = 15  # 1/z, u/z, v/z, light column/z, light row/z, three coefficients each
_SAMPLE_X = np.array([0.125, 0.375, 0.625, 0.875]) - 0.5
_SAMPLE_Y = np.array([0.625, 0.125, 0.875, 0.375]) - 0.5
_OPTIONS = {"cache": True, "fastmath": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def sample_offset(s: int, y: int) -> float:
    """Column offset of sample `s` from its pixel's centre in row `y`."""
    return _SAMPLE_X[s] + 0.25 * ((y * 0.618034) % 1.0 - 0.5)


@njit(**_OPTIONS)
def project(vertices, uv, light_uv, texture_size, texture, one_sided, rotation, eye, lens, size,
            corners, owner, planes, source):  # fmt: skip
    """Cull, clip at the near plane and project all triangles.

    Fills `corners` (m, 9: x, y, 1/z of each corner) and `owner` (m) per screen triangle, `planes`
    (k, 15) and `source` (k) per visible triangle; returns (m, k).
    """
    focal, cx, cy = lens[0], lens[1], lens[2]
    width, height = size[0], size[1]
    p = np.empty((3, 3))
    c = np.empty((5, 3))
    n = 0
    visible = 0
    for i in range(vertices.shape[0]):
        left = right = above = below = behind = True
        for k in range(3):
            a = vertices[i, k, 0] - eye[0]
            b = vertices[i, k, 1] - eye[1]
            d = vertices[i, k, 2] - eye[2]
            x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * d
            y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * d
            z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * d
            p[k, 0], p[k, 1], p[k, 2] = x, y, z
            behind &= z < NEAR_M
            left &= focal * x < (-1.0 - cx) * z
            right &= focal * x > (width - cx) * z
            above &= focal * y < (-1.0 - cy) * z
            below &= focal * y > (height - cy) * z
        if behind or left or right or above or below:
            continue
        # Rows of the adjugate of [p0 p1 p2], and the determinant: negative when facing the eye.
        c0x = p[1, 1] * p[2, 2] - p[1, 2] * p[2, 1]
        c0y = p[1, 2] * p[2, 0] - p[1, 0] * p[2, 2]
        c0z = p[1, 0] * p[2, 1] - p[1, 1] * p[2, 0]
        det = p[0, 0] * c0x + p[0, 1] * c0y + p[0, 2] * c0z
        if abs(det) < 1e-13 or (one_sided[i] and det > 0.0):
            continue
        c1x = p[2, 1] * p[0, 2] - p[2, 2] * p[0, 1]
        c1y = p[2, 2] * p[0, 0] - p[2, 0] * p[0, 2]
        c1z = p[2, 0] * p[0, 1] - p[2, 1] * p[0, 0]
        c2x = p[0, 1] * p[1, 2] - p[0, 2] * p[1, 1]
        c2y = p[0, 2] * p[1, 0] - p[0, 0] * p[1, 2]
        c2z = p[0, 0] * p[1, 1] - p[0, 1] * p[1, 0]
        for q in range(5):
            f0 = f1 = f2 = 1.0
            if q == 1 or q == 2:
                scale = texture_size[texture[i], q - 1]
                f0, f1, f2 = uv[i, 0, q - 1], uv[i, 1, q - 1], uv[i, 2, q - 1]
                # Whole repeats are dropped for precision.
                base = math.floor(min(f0, f1, f2))
                f0, f1, f2 = (f0 - base) * scale, (f1 - base) * scale, (f2 - base) * scale
            elif q > 2:
                f0, f1, f2 = light_uv[i, 0, q - 3], light_uv[i, 1, q - 3], light_uv[i, 2, q - 3]
            gx = (c0x * f0 + c1x * f1 + c2x * f2) / (det * focal)
            gy = (c0y * f0 + c1y * f1 + c2y * f2) / (det * focal)
            planes[visible, 3 * q] = gx
            planes[visible, 3 * q + 1] = gy
            gz = (c0z * f0 + c1z * f1 + c2z * f2) / det
            planes[visible, 3 * q + 2] = gz - gx * cx - gy * cy
        m = 0
        for k in range(3):
            j = (k + 1) % 3
            za, zb = p[k, 2] - NEAR_M, p[j, 2] - NEAR_M
            if za >= 0.0:
                c[m, 0], c[m, 1], c[m, 2] = p[k, 0], p[k, 1], p[k, 2]
                m += 1
            if (za >= 0.0) != (zb >= 0.0):
                s = za / (za - zb)
                for e in range(3):
                    c[m, e] = p[k, e] + s * (p[j, e] - p[k, e])
                m += 1
        for k in range(1, m - 1):
            for e in range(3):
                j = 0 if e == 0 else k + e - 1
                w = 1.0 / c[j, 2]
                corners[n, 3 * e] = focal * c[j, 0] * w + cx
                corners[n, 3 * e + 1] = focal * c[j, 1] * w + cy
                corners[n, 3 * e + 2] = w
            owner[n] = visible
            n += 1
        source[visible] = i
        visible += 1
    return n, visible


@njit(**_OPTIONS)
def rasterise(corners, owner, count, planes, nearest, visible):
    """Nearest triangle per sample: `nearest` float32 1/z and `visible` int32, (4, h, w)."""
    height, width = nearest.shape[1], nearest.shape[2]
    nearest[:] = 0.0
    visible[:] = -1
    for i in range(count):
        x0, y0 = corners[i, 0], corners[i, 1]
        x1, y1 = corners[i, 3], corners[i, 4]
        x2, y2 = corners[i, 6], corners[i, 7]
        k = owner[i]
        dwx, dwy, w0 = np.float32(planes[k, 0]), planes[k, 1], planes[k, 2]
        low, high = min(y0, y1, y2), max(y0, y1, y2)
        # An edge that spans no sample row is never asked for its slope.
        s0 = (x1 - x0) / (y1 - y0) if y1 != y0 else 0.0
        s1 = (x2 - x1) / (y2 - y1) if y2 != y1 else 0.0
        s2 = (x0 - x2) / (y0 - y2) if y0 != y2 else 0.0
        for s in range(SAMPLES):
            dy = _SAMPLE_Y[s]
            first = max(0, math.ceil(low - dy))
            last = min(height - 1, math.ceil(high - dy) - 1)
            for y in range(first, last + 1):
                yc = y + dy
                dx = sample_offset(s, y)
                xl, xr = 1e9, -1e9
                if (y0 <= yc) != (y1 <= yc):
                    x = x0 + (yc - y0) * s0
                    xl, xr = min(xl, x), max(xr, x)
                if (y1 <= yc) != (y2 <= yc):
                    x = x1 + (yc - y1) * s1
                    xl, xr = min(xl, x), max(xr, x)
                if (y2 <= yc) != (y0 <= yc):
                    x = x2 + (yc - y2) * s2
                    xl, xr = min(xl, x), max(xr, x)
                if xr < xl:
                    continue
                start = max(0, math.ceil(max(xl, -1e6) - dx))
                stop = min(width, math.ceil(min(xr, 1e6) - dx))
                w_row = np.float32(w0 + dwy * yc + planes[k, 0] * (start + dx))
                row_w, row_v = nearest[s, y], visible[s, y]
                for x in range(start, stop):
                    w = w_row + dwx * np.float32(x - start)
                    if w > row_w[x]:
                        row_w[x] = w
                        row_v[x] = k


@njit(inline="always", **_OPTIONS)
def _bilinear(texels, offset, log2_w, log2_h, u, v):
    """Repeating bilinear look-up; (u, v) in texels of this level, centres at halves."""
    x, y = u - 0.5, v - 0.5
    xf, yf = math.floor(x), math.floor(y)
    a, b = x - xf, y - yf
    mask_w, mask_h = (1 << log2_w) - 1, (1 << log2_h) - 1
    xi, yi = int(xf) & mask_w, int(yf) & mask_h
    xj, yj = (xi + 1) & mask_w, (yi + 1) & mask_h
    r0, r1 = offset + (yi << log2_w), offset + (yj << log2_w)
    top = (1.0 - a) * texels[r0 + xi] + a * texels[r0 + xj]
    bottom = (1.0 - a) * texels[r1 + xi] + a * texels[r1 + xj]
    return (1.0 - b) * top + b * bottom


@njit(inline="always", **_OPTIONS)
def _sample(texels, offsets, t, log2_w, log2_h, levels, u, v, dux, dvx, duy, dvy, anisotropy):
    """Filtered texture at (u, v), texels of level 0, for the pixel's footprint.

    Several trilinear-free taps along the footprint's longer axis, on the level that fits one tap.
    """
    along_x, along_y = dux * dux + dvx * dvx, duy * duy + dvy * dvy
    if along_x > along_y:
        major, minor, mu, mv = along_x, along_y, dux, dvx
    else:
        major, minor, mu, mv = along_y, along_x, duy, dvy
    taps, level = 1, 0
    if major > 1.0:
        taps = min(anisotropy, int(math.sqrt(major / max(minor, 1.0)) + 0.8))
        taps = max(taps, 1)
        area = major / (taps * taps)
        while area > 2.0 and level < levels - 1:
            area *= 0.25
            level += 1
    scale = 1.0 / (1 << level)
    lw, lh = max(log2_w - level, 0), max(log2_h - level, 0)
    step = scale / taps
    su, sv = mu * step, mv * step
    u0 = u * scale - 0.5 * (taps - 1) * su
    v0 = v * scale - 0.5 * (taps - 1) * sv
    total = 0.0
    for k in range(taps):
        total += _bilinear(texels, offsets[t, level], lw, lh, u0 + k * su, v0 + k * sv)
    return total / taps


@njit(inline="always", **_OPTIONS)
def _light(light, offset, columns, rows, u, v):
    """Bilinear light, clamped to the face's map."""
    u = min(max(u, 0.0), columns - 1.0)
    v = min(max(v, 0.0), rows - 1.0)
    x, y = min(int(u), columns - 2), min(int(v), rows - 2)
    a, b = u - x, v - y
    r = offset + y * columns + x
    top = (1.0 - a) * light[r] + a * light[r + 1]
    return (1.0 - b) * top + b * ((1.0 - a) * light[r + columns] + a * light[r + columns + 1])


@njit(inline="always", **_OPTIONS)
def _grey(g, k, i, x, y, texture, texels, offsets, log2_size, levels, light_map, light, anisotropy):
    """Grey of visible triangle `k`, the mesh's triangle `i`, at screen position (x, y).

    Rows of the arrays are never sliced off: a slice would be counted in and out at each pixel.
    """
    z = 1.0 / (g[k, 0] * x + g[k, 1] * y + g[k, 2])
    u = (g[k, 3] * x + g[k, 4] * y + g[k, 5]) * z
    v = (g[k, 6] * x + g[k, 7] * y + g[k, 8]) * z
    t = texture[i]
    grey = _sample(
        texels, offsets, t, log2_size[t, 0], log2_size[t, 1], levels[t], u, v,
        (g[k, 3] - u * g[k, 0]) * z, (g[k, 6] - v * g[k, 0]) * z,
        (g[k, 4] - u * g[k, 1]) * z, (g[k, 7] - v * g[k, 1]) * z, anisotropy,
    )  # fmt: skip
    lu = (g[k, 9] * x + g[k, 10] * y + g[k, 11]) * z
    lv = (g[k, 12] * x + g[k, 13] * y + g[k, 14]) * z
    return grey * _light(light, light_map[i, 0], light_map[i, 1], light_map[i, 2], lu, lv)


@njit(**_OPTIONS)
def shade(visible, planes, source, texture, texels, offsets, log2_size, levels,
          light_map, light, anisotropy, background, grey, inverse_depth):  # fmt: skip
    """Fill `grey` and `inverse_depth` (1/m, 0 where nothing is seen), float32 (h, w)."""
    height, width = grey.shape
    for y in range(height):
        for x in range(width):
            k = visible[0, y, x]
            if k == visible[1, y, x] and k == visible[2, y, x] and k == visible[3, y, x]:
                if k < 0:
                    grey[y, x] = background
                    inverse_depth[y, x] = 0.0
                    continue
                inverse_depth[y, x] = planes[k, 0] * x + planes[k, 1] * y + planes[k, 2]
                grey[y, x] = _grey(planes, k, source[k], x, y, texture, texels, offsets, log2_size,
                                   levels, light_map, light, anisotropy)  # fmt: skip
                continue
            total, most, depth = 0.0, 0, 0.0
            for s in range(SAMPLES):
                k = visible[s, y, x]
                n, sx, sy = 0, 0.0, 0.0
                seen = False
                for r in range(SAMPLES):
                    if visible[r, y, x] == k:
                        seen |= r < s
                        n += 1
                        sx += sample_offset(r, y)
                        sy += _SAMPLE_Y[r]
                if seen:
                    continue
                w = 0.0
                if k < 0:
                    total += n * background
                else:
                    px, py = x + sx / n, y + sy / n
                    total += n * _grey(planes, k, source[k], px, py, texture, texels, offsets,
                                       log2_size, levels, light_map, light, anisotropy)  # fmt: skip
                    w = planes[k, 0] * x + planes[k, 1] * y + planes[k, 2]
                    if w <= 0.0:
                        w = planes[k, 0] * px + planes[k, 1] * py + planes[k, 2]
                # The pixel's depth is that of the surface with most samples, else the nearest.
                if n > most or (n == most and w > depth):
                    most, depth = n, w
            grey[y, x] = total / SAMPLES
            inverse_depth[y, x] = depth
