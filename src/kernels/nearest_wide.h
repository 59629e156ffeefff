// SPDX-License-Identifier: Apache-2.0
// The loops of nearest.c for one instruction set. Included once for each, with
//
// SET(name): the name's form for this set.
//
// TARGET: the attribute that turns the set on.
//
// WIDTH, Vector: floats in a vector, and its type (any float's alignment will do).
//
// ROWS: queries of a tile in one go: 2 * ROWS sums, 2 numbers of a candidate, 1 of a query fit the registers.
//
// LEAST(a, b): the lesser, number by number.
//
// BELOW(a, limit): bit i: a[i] <= limit[i].
//
// LIST_BITS(bits, base, list): base + the number of every bit set, and how many there are.

TARGET static inline __attribute__((always_inline)) void SET(tile_piece)(const float *queries, const float *candidates,
                                                                         int numbers, const float *start, float *out,
                                                                         ptrdiff_t stride)
{
    Vector left[ROWS], right[ROWS];
#pragma GCC unroll 12
    for (int q = 0; q < ROWS; ++q)
    {
        left[q] = *(const Vector *)start;
        right[q] = *(const Vector *)(start + WIDTH);
    }
    for (int k = 0; k < numbers; ++k)
    {
        Vector l = *(const Vector *)candidates, r = *(const Vector *)(candidates + WIDTH);
#pragma GCC unroll 12
        for (int q = 0; q < ROWS; ++q)
        {
            left[q] += queries[q] * l;
            right[q] += queries[q] * r;
        }
        queries += RF_TILE_QUERIES;
        candidates += RF_TILE_CANDIDATES;
    }
#pragma GCC unroll 12
    for (int q = 0; q < ROWS; ++q)
    {
        *(Vector *)(out + q * stride) = left[q];
        *(Vector *)(out + q * stride + WIDTH) = right[q];
    }
}

TARGET static void SET(tile_products)(const float *queries, const float *candidates, int numbers, const float *start,
                                      float *out, ptrdiff_t stride)
{
    for (int c = 0; c < RF_TILE_CANDIDATES; c += 2 * WIDTH)
        for (int q = 0; q < RF_TILE_QUERIES; q += ROWS)
            SET(tile_piece)(queries + q, candidates + c, numbers, start + c, out + q * stride + c, stride);
}

TARGET static inline __attribute__((always_inline)) void
SET(project_piece)(const float *windows, int numbers, const float *basis, float *out, ptrdiff_t stride)
{
    Vector left[ROWS] = {0}, right[ROWS] = {0};
    for (; numbers > 0; numbers -= RF_WINDOW_BLOCK, windows += RF_TILE_QUERIES * RF_WINDOW_BLOCK)
        for (int k = 0; k < rf_min_int(RF_WINDOW_BLOCK, numbers); ++k, basis += RF_TILE_CANDIDATES)
        {
            Vector l = *(const Vector *)basis, r = *(const Vector *)(basis + WIDTH);
#pragma GCC unroll 12
            for (int q = 0; q < ROWS; ++q)
            {
                left[q] += windows[q * RF_WINDOW_BLOCK + k] * l;
                right[q] += windows[q * RF_WINDOW_BLOCK + k] * r;
            }
        }
#pragma GCC unroll 12
    for (int q = 0; q < ROWS; ++q)
    {
        *(Vector *)(out + q * stride) = left[q];
        *(Vector *)(out + q * stride + WIDTH) = right[q];
    }
}

TARGET static void SET(project)(const float *windows, int numbers, const float *basis, float *out, ptrdiff_t stride)
{
    for (int c = 0; c < RF_TILE_CANDIDATES; c += 2 * WIDTH)
        for (int q = 0; q < RF_TILE_QUERIES; q += ROWS)
            SET(project_piece)(windows + q * RF_WINDOW_BLOCK, numbers, basis + c, out + q * stride + c, stride);
}

TARGET static void SET(fold_group)(const float *bounds, ptrdiff_t bounds_stride, int queries, float *minima,
                                   ptrdiff_t minima_stride)
{
    for (int q = 0; q < queries; ++q, bounds += bounds_stride, minima += minima_stride)
        for (int lane = 0; lane < RF_GROUP_LANES; lane += WIDTH)
        {
            Vector least = *(const Vector *)(bounds + lane);
#pragma GCC unroll 8
            for (int i = RF_GROUP_LANES; i < RF_GROUP_CANDIDATES; i += RF_GROUP_LANES)
                least = LEAST(least, *(const Vector *)(bounds + i + lane));
            *(Vector *)(minima + lane) = least;
        }
}

TARGET static int SET(find_least)(const float *bounds, const float *minima, int count, float *value)
{
    Vector all = *(const Vector *)minima;
    for (int i = WIDTH; i < count; i += WIDTH)
        all = LEAST(all, *(const Vector *)(minima + i));
    float lanes[WIDTH];
    *(Vector *)lanes = all;
#pragma GCC unroll 4
    for (int half = WIDTH / 2; half > 0; half /= 2)
#pragma GCC unroll 8
        for (int i = 0; i < half; ++i)
            lanes[i] = rf_min(lanes[i + half], lanes[i]);
    *value = lanes[0];
    Vector limit = lanes[0] - (Vector){0};
    for (int i = 0; i < count; i += WIDTH)
    {
        unsigned bits = BELOW(*(const Vector *)(minima + i), limit);
        if (!bits)
            continue;
        int lane = i + __builtin_ctz(bits), found = lane / RF_GROUP_LANES * RF_GROUP_CANDIDATES + lane % RF_GROUP_LANES,
            first = found;
        for (int c = first; c < first + RF_GROUP_CANDIDATES; c += RF_GROUP_LANES)
            found = bounds[c] <= lanes[0] ? c : found;
        return found;
    }
    return 0;
}

// Lanes first, then the candidates that share them: no branch of the second loop has to be guessed, so that their cache
// lines are on the way together.
TARGET static int SET(list_below)(const float *bounds, const float *minima, int count, float limit, int *list)
{
    Vector limits = limit - (Vector){0};
    int lanes[RF_MAX_LANES + WIDTH], found = 0, listed = 0;
    for (int i = 0; i < count; i += WIDTH)
        found += LIST_BITS(BELOW(*(const Vector *)(minima + i), limits), i, lanes + found);
    for (int n = 0; n < found; ++n)
    {
        int first = lanes[n] / RF_GROUP_LANES * RF_GROUP_CANDIDATES + lanes[n] % RF_GROUP_LANES;
#pragma GCC unroll 8
        for (int c = first; c < first + RF_GROUP_CANDIDATES; c += RF_GROUP_LANES)
        {
            list[listed] = c;
            listed += bounds[c] <= limit;
        }
    }
    return listed;
}

#undef SET
#undef TARGET
#undef WIDTH
#undef Vector
#undef ROWS
#undef LEAST
#undef BELOW
#undef LIST_BITS
