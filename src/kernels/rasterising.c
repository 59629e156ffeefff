// SPDX-License-Identifier: Apache-2.0
// A grid is 2 (n - 1)^2 triangles; over a triangle the exemplar coordinates and the vertex weights are linear. All rows
// of a triangle are found at once, then written one by one.
//
// Edges: rows and points are half-open intervals and an edge's crossing is computed from its ends in one order, so two
// triangles that share an edge leave no gap between them. Where a grid folds over itself the later triangle shows; its
// quality is 0 there.

#include "kernels/rasterising.h"
#include "core/maths.h"
#include "core/simd.h"
#include "kernels/extrapolation.h"

#include <assert.h>

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));

// Points.
#define FARTHEST 1e6f

// The part of the area that the kernel's circle can reach, in points.
typedef struct Region
{
    float x0, y0, x1, y1;
    // The circle, in units of the spacing; `aspect` is a row's height in it.
    float cx, cy, radius, aspect;
} Region;

RF_WIDE_BODY Region region_of(const RfRasterArea *area, const RfDrawGrid *grid, float reach)
{
    float inverse = 1 / area->spacing, row_inverse = 1 / area->row_spacing, radius = reach * inverse;
    float cx = (grid->centre.x - area->origin.x) * inverse, cy = (grid->centre.y - area->origin.y) * row_inverse;
    return (Region){rf_max(cx - radius, 0),
                    rf_max(cy - reach * row_inverse, 0),
                    rf_min(cx + radius, (float)area->width),
                    rf_min(cy + reach * row_inverse, (float)area->height),
                    cx,
                    cy,
                    radius,
                    area->row_spacing * inverse};
}

typedef struct Corner
{
    float x, y;
    Vec4 value; // u, v, K_g K_d, nothing
} Corner;

// A grid's vertices in points, and on which sides they lie of the region and of an octagon round the circle.
typedef struct Vertices
{
    float x[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES], y[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    uint8_t outside[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
} Vertices;

RF_WIDE_BODY void place_vertices(const RfRasterArea *area, const RfDrawGrid *grid, const Region *region,
                                 Vertices *vertices)
{
    float inverse = 1 / area->spacing, row_inverse = 1 / area->row_spacing;
    float cx = region->cx, cy = region->cy, aspect = region->aspect, diagonal = region->radius * sqrtf(2);
    int count = grid->n * grid->n;
#pragma omp simd
    for (int k = 0; k < count; ++k)
    {
        // NaN and the absurdly far come to rest where integers still hold them.
        float x = rf_clamp((grid->x[k] - area->origin.x) * inverse, -FARTHEST, FARTHEST);
        float y = rf_clamp((grid->y[k] - area->origin.y) * row_inverse, -FARTHEST, FARTHEST);
        float dx = x - cx, dy = (y - cy) * aspect;
        vertices->x[k] = x;
        vertices->y[k] = y;
        vertices->outside[k] =
            (uint8_t)((x < region->x0 ? 1 : 0) | (x > region->x1 ? 2 : 0) | (y < region->y0 ? 4 : 0) |
                      (y > region->y1 ? 8 : 0) | (dx + dy < -diagonal ? 16 : 0) | (dx + dy > diagonal ? 32 : 0) |
                      (dx - dy < -diagonal ? 64 : 0) | (dx - dy > diagonal ? 128 : 0));
    }
}

RF_WIDE_BODY Corner corner_of(const RfDrawGrid *grid, const Vertices *vertices, int i, int j)
{
    int k = j * grid->n + i;
    bool border = i == 0 || j == 0 || i == grid->n - 1 || j == grid->n - 1;
    return (Corner){
        vertices->x[k],
        vertices->y[k],
        {grid->u0 + (float)i * grid->cell, grid->v0 + (float)j * grid->cell, border ? 0.0f : grid->quality[k], 0}};
}

RF_WIDE_BODY bool is_above(const Corner *p, const Corner *q)
{
    return p->y < q->y || (p->y == q->y && p->x < q->x);
}

// Writes `count` pixels; u0, v0, w0 are the values at the first and dx their slopes along x.
RF_WIDE_BODY void write_pixels(RfRasterPlanes *planes, int place, int count, float u0, float v0, float w0, Vec4 dx)
{
    float *restrict u = planes->u + place, *restrict v = planes->v + place, *restrict weight = planes->weight + place;
    float du = dx[0], dv = dx[1], dw = dx[2];
    const int stop = rf_whole_vectors(count);
#pragma omp simd
    for (int k = 0; k < stop; ++k)
    {
        float along = (float)k;
        if (k < count)
        {
            u[k] = u0 + along * du;
            v[k] = v0 + along * dv;
            weight[k] = rf_max(w0 + along * dw, 0);
        }
    }
}

RF_WIDE_BODY float slope_of(const Corner *p, const Corner *q)
{
    return q->y > p->y ? (q->x - p->x) / (q->y - p->y) : 0;
}

// Pixels of a triangle's rows: [first, end), end <= first where there are none; and the values there.
typedef struct TriangleRows
{
    int first[RF_TILE_ROWS + RF_WIDE_FLOATS], end[RF_TILE_ROWS + RF_WIDE_FLOATS];
    // At the first pixel.
    float u[RF_TILE_ROWS + RF_WIDE_FLOATS], v[RF_TILE_ROWS + RF_WIDE_FLOATS], weight[RF_TILE_ROWS + RF_WIDE_FLOATS];
} TriangleRows;

// All rows of the triangle a, b, c (from top to bottom) at once.
RF_WIDE_BODY void find_rows(const Region *region, const Corner *a, const Corner *b, const Corner *c, Vec4 start,
                            Vec4 dx, Vec4 dy, int first_row, int end_row, RfRasterExtent *extent, TriangleRows *rows)
{
    float slope_ac = slope_of(a, c), slope_ab = slope_of(a, b), slope_bc = slope_of(b, c);
    float ax = a->x, ay = a->y, bx = b->x, by = b->y, x0 = region->x0, x1 = region->x1;
    float cx = region->cx, cy = region->cy, aspect = region->aspect, radius2 = region->radius * region->radius;
    float su = start[0], sv = start[1], sw = start[2], dxu = dx[0], dxv = dx[1], dxw = dx[2], dyu = dy[0], dyv = dy[1],
          dyw = dy[2];
    int count = end_row - first_row;
    int *restrict least = extent->first + first_row, *restrict most = extent->end + first_row;
    const int stop = rf_whole_vectors(count);
#pragma omp simd
    for (int k = 0; k < stop; ++k)
    {
        float y = (float)(first_row + k) + 0.5f, along = ax + (y - ay) * slope_ac;
        float upper = ax + (y - ay) * slope_ab, lower = bx + (y - by) * slope_bc, other = y < by ? upper : lower;
        float dy = (y - cy) * aspect, chord = sqrtf(rf_max(radius2 - dy * dy, 0));
        float left = rf_max(rf_min(along, other), rf_max(x0, cx - chord));
        float right = rf_min(rf_max(along, other), rf_min(x1, cx + chord));
        int first = (int)ceilf(left - 0.5f), end = (int)ceilf(right - 0.5f);
        bool some = k < count && end > first;
        rows->first[k] = first;
        rows->end[k] = end;
        rows->u[k] = su + (float)first * dxu + (y - 0.5f) * dyu;
        rows->v[k] = sv + (float)first * dxv + (y - 0.5f) * dyv;
        rows->weight[k] = sw + (float)first * dxw + (y - 0.5f) * dyw;
        least[k] = some && first < least[k] ? first : least[k];
        most[k] = some && end > most[k] ? end : most[k];
    }
}

RF_WIDE_BODY void rasterise_triangle(const Region *region, const Corner *p, const Corner *q, const Corner *r,
                                     RfRasterPlanes *planes, RfRasterExtent *extent)
{
    // a, b, c from top to bottom.
    const Corner *a = p, *b = q, *c = r, *swap;
    if (is_above(b, a))
        swap = a, a = b, b = swap;
    if (is_above(c, b))
        swap = b, b = c, c = swap;
    if (is_above(b, a))
        swap = a, a = b, b = swap;
    float abx = b->x - a->x, aby = b->y - a->y, acx = c->x - a->x, acy = c->y - a->y, det = abx * acy - aby * acx;
    if (!(det > 1e-6f || det < -1e-6f))
        return;
    float inverse = 1 / det;
    Vec4 ab = b->value - a->value, ac = c->value - a->value;
    Vec4 dx = (ab * acy - ac * aby) * inverse, dy = (ac * abx - ab * acx) * inverse;
    Vec4 start = a->value + (0.5f - a->x) * dx + (0.5f - a->y) * dy;
    int first_row = (int)ceilf(rf_max(a->y, region->y0) - 0.5f), end_row = (int)ceilf(rf_min(c->y, region->y1) - 0.5f);
    if (end_row <= first_row)
        return;
    TriangleRows rows;
    find_rows(region, a, b, c, start, dx, dy, first_row, end_row, extent, &rows);
    for (int k = 0; k < end_row - first_row; ++k)
        if (rows.end[k] > rows.first[k])
            write_pixels(planes, (first_row + k) * RF_TILE_PITCH + rows.first[k], rows.end[k] - rows.first[k],
                         rows.u[k], rows.v[k], rows.weight[k], dx);
}

RF_WIDE_BODY void rf_rasterise_body(const RfRasterArea *area, const RfDrawGrid *grid, float reach,
                                    RfRasterPlanes *planes, RfRasterExtent *extent)
{
    assert(area->width <= RF_TILE_COLUMNS && area->height <= RF_TILE_ROWS);
    for (int y = 0; y < RF_TILE_ROWS; ++y)
    {
        extent->first[y] = RF_TILE_COLUMNS;
        extent->end[y] = 0;
    }
    Region region = region_of(area, grid, reach);
    Vertices vertices;
    place_vertices(area, grid, &region, &vertices);
    const uint8_t *outside = vertices.outside;
    for (int j = 0; j + 1 < grid->n; ++j)
        for (int i = 0; i + 1 < grid->n; ++i)
        {
            int k = j * grid->n + i;
            if (outside[k] & outside[k + 1] & outside[k + grid->n] & outside[k + grid->n + 1])
                continue;
            Corner a = corner_of(grid, &vertices, i, j), b = corner_of(grid, &vertices, i + 1, j);
            Corner c = corner_of(grid, &vertices, i, j + 1), d = corner_of(grid, &vertices, i + 1, j + 1);
            rasterise_triangle(&region, &a, &b, &c, planes, extent);
            rasterise_triangle(&region, &d, &c, &b, planes, extent);
        }
}

RF_WIDE(rf_rasterise,
        (const RfRasterArea *area, const RfDrawGrid *grid, float reach, RfRasterPlanes *planes, RfRasterExtent *extent),
        (area, grid, reach, planes, extent))
