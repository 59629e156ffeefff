// SPDX-License-Identifier: Apache-2.0
// Halko, Martinsson, Tropp. Finding structure with randomness: probabilistic algorithms for constructing approximate
// matrix decompositions. 2011 (subspace iteration, section 4.5, and its last step, Rayleigh and Ritz's).
//
// X holds a vector a row. A random basis B, multiplied by X^T X and made orthonormal a few times, turns towards the
// leading eigenvectors; the small matrix (X B)^T (X B), diagonalised by Jacobi rotations, then sorts them.
//
//     repeat:  Y = X B,  B = orthonormal(X^T Y)
//     last:    H = Y^T Y = V diag(variances) V^T,  B = B V
//
// Why not LAPACK? ssyevr on the covariance is as fast up to some 300 numbers a window, but grows with their cube (7 s
// for 17 x 17 windows of 16 channels, where a whole database takes 0.6 s this way), so the iteration is needed in any
// case. It is short on top of the search's own tile; it reads a window at a time and stores no covariance; and its
// result does not depend on threads without telling OpenBLAS, on behalf of a whole process, how many to use. What a
// finite iteration on a sample leaves (0.1 to 0.7 % of the variance) costs a few full comparisons and no exactness.

#include "kernels/principal.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/result.h"
#include "core/simd.h"

#include <math.h>
#include <string.h>

enum
{
    // 31 components of 9 x 9 x 2 numbers then hold 95.5 % of foam, 77.9 % of bubbles, 88.8 % of lava; the best
    // ones 95.6, 78.6 and 89.0.
    ITERATIONS = 3,
    // Fixed, so that sums do not depend on the number of threads.
    PARTS = 8,
    JACOBI_SWEEPS = 12
};

void rf_project_panel(const float *panel, int numbers, const float *basis, int blocks, float *products)
{
    static const float zeros[RF_BASIS_BLOCK] __attribute__((aligned(64))) = {0};
    for (int b = 0; b < blocks; ++b)
        rf_tile_products(panel, basis + (size_t)b * (size_t)numbers * RF_BASIS_BLOCK, numbers, zeros,
                         products + b * RF_BASIS_BLOCK, blocks * RF_BASIS_BLOCK);
}

typedef struct Pass
{
    const RfPanelReader *reader;
    const float *basis;
    int blocks;
    // [PARTS]: panel[numbers][12], products[12][columns]; covariance times basis [blocks][numbers][32]
    float *panels, *products, *images;
    // [PARTS][columns][columns] of H, [PARTS] of the total
    double *gram, *total;
} Pass;

// image[k][c] += sum over the panel's 12 vectors q: panel[k][q] products[q][c]
RF_WIDE_BODY void add_image_body(const float *restrict panel, const float *restrict products, int stride, int numbers,
                                 float *restrict image)
{
    for (int k = 0; k < numbers; ++k, image += RF_BASIS_BLOCK, panel += RF_TILE_QUERIES)
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            for (int c = 0; c < RF_BASIS_BLOCK; ++c)
                image[c] += panel[q] * products[q * stride + c];
}

static void add_image(const float *restrict panel, const float *restrict products, int stride, int numbers,
                      float *restrict image);
RF_WIDE(add_image,
        (const float *restrict panel, const float *restrict products, int stride, int numbers, float *restrict image),
        (panel, products, stride, numbers, image))

static void add_gram(const float *products, int columns, double *gram)
{
    for (int q = 0; q < RF_TILE_QUERIES; ++q, products += columns)
        for (int i = 0; i < columns; ++i)
            for (int j = 0; j < columns; ++j)
                gram[i * columns + j] += (double)products[i] * (double)products[j];
}

static void pass_part(void *context, int part, int worker)
{
    (void)worker;
    const Pass *pass = context;
    int numbers = pass->reader->numbers, columns = pass->blocks * RF_BASIS_BLOCK;
    size_t block = (size_t)numbers * RF_BASIS_BLOCK, place = (size_t)part;
    float *panel = pass->panels + place * (size_t)numbers * RF_TILE_QUERIES,
          *products = pass->products + place * (size_t)columns * RF_TILE_QUERIES,
          *image = pass->images + place * (size_t)pass->blocks * block;
    double *gram = pass->gram + place * (size_t)columns * (size_t)columns, total = 0;
    memset(image, 0, (size_t)pass->blocks * block * sizeof *image);
    memset(gram, 0, (size_t)columns * (size_t)columns * sizeof *gram);
    for (int item = part * RF_TILE_QUERIES; item < pass->reader->items; item += PARTS * RF_TILE_QUERIES)
    {
        pass->reader->read(pass->reader->context, item, panel);
        rf_project_panel(panel, numbers, pass->basis, pass->blocks, products);
        for (int b = 0; b < pass->blocks; ++b)
            add_image(panel, products + b * RF_BASIS_BLOCK, columns, numbers, image + (size_t)b * block);
        add_gram(products, columns, gram);
        for (int k = 0; k < numbers * RF_TILE_QUERIES; ++k)
            total += (double)panel[k] * (double)panel[k];
    }
    pass->total[part] = total;
}

// vectors[columns][numbers] becomes orthonormal (Gram and Schmidt, twice over, in double). What is left of a vector
// that depends on those before it is rounding of the float products: as good a direction as any. Exact zeros stay.
static void make_orthonormal(double *vectors, int columns, int numbers)
{
    double largest = 0;
    for (int i = 0; i < columns; ++i)
    {
        double *v = vectors + (size_t)i * (size_t)numbers, squares = 0;
        for (int round = 0; round < 2; ++round)
            for (int j = 0; j < i; ++j)
            {
                const double *u = vectors + (size_t)j * (size_t)numbers;
                double product = 0;
#pragma omp simd reduction(+ : product)
                for (int k = 0; k < numbers; ++k)
                    product += u[k] * v[k];
                for (int k = 0; k < numbers; ++k)
                    v[k] -= product * u[k];
            }
        for (int k = 0; k < numbers; ++k)
            squares += v[k] * v[k];
        largest = squares > largest ? squares : largest;
        double scale = squares > 1e-24 * largest && squares > 0 ? 1 / sqrt(squares) : 0;
        for (int k = 0; k < numbers; ++k)
            v[k] *= scale;
    }
}

// Cyclic Jacobi: the symmetric h[n][n] becomes diagonal, the columns of v its eigenvectors.
static void diagonalise(double *h, double *v, int n)
{
    for (int i = 0; i < n * n; ++i)
        v[i] = i % (n + 1) == 0;
    for (int sweep = 0; sweep < JACOBI_SWEEPS; ++sweep)
        for (int p = 0; p < n; ++p)
            for (int q = p + 1; q < n; ++q)
            {
                double apq = h[p * n + q];
                if (fabs(apq) <= 1e-12 * sqrt(fabs(h[p * n + p] * h[q * n + q])))
                    continue;
                // The smaller root of t^2 + 2 t theta - 1 = 0.
                double theta = (h[q * n + q] - h[p * n + p]) / (2 * apq),
                       t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1),
                       s = t * c;
                for (int k = 0; k < n; ++k)
                {
                    double a = h[k * n + p], b = h[k * n + q];
                    h[k * n + p] = c * a - s * b;
                    h[k * n + q] = s * a + c * b;
                }
                for (int k = 0; k < n; ++k)
                {
                    double a = h[p * n + k], b = h[q * n + k];
                    h[p * n + k] = c * a - s * b;
                    h[q * n + k] = s * a + c * b;
                    a = v[k * n + p], b = v[k * n + q];
                    v[k * n + p] = c * a - s * b;
                    v[k * n + q] = s * a + c * b;
                }
            }
}

typedef struct Work
{
    // [columns][numbers]
    double *vectors;
    double *turn;
    float *memory;
    double *sums;
} Work;

static RfResult make_work(const RfPanelReader *reader, int blocks, Work *work, Pass *pass)
{
    size_t numbers = (size_t)reader->numbers, columns = (size_t)blocks * RF_BASIS_BLOCK;
    work->vectors = rf_allocate(columns * numbers, sizeof *work->vectors);
    work->turn = rf_allocate(columns * columns, sizeof *work->turn);
    work->sums = rf_allocate_zero(PARTS * (columns * columns + 1), sizeof *work->sums);
    work->memory = rf_allocate(PARTS * (numbers * RF_TILE_QUERIES + columns * RF_TILE_QUERIES + numbers * columns) + 16,
                               sizeof *work->memory);
    if (!work->vectors || !work->turn || !work->sums || !work->memory)
        return RF_OUT_OF_MEMORY;
    // Products first: their rows are whole cache lines.
    pass->products = work->memory;
    pass->images = pass->products + PARTS * columns * RF_TILE_QUERIES;
    pass->panels = pass->images + PARTS * numbers * columns;
    pass->gram = work->sums;
    pass->total = work->sums + PARTS * columns * columns;
    return RF_OK;
}

// basis[block][k][c] from vectors[block * 32 + c][k]
static void write_basis(const double *vectors, int blocks, int numbers, float *basis)
{
    for (int b = 0; b < blocks; ++b)
        for (int k = 0; k < numbers; ++k)
            for (int c = 0; c < RF_BASIS_BLOCK; ++c)
                *basis++ = (float)vectors[(size_t)(b * RF_BASIS_BLOCK + c) * (size_t)numbers + (size_t)k];
}

static void add_images(const Pass *pass, double *vectors)
{
    int numbers = pass->reader->numbers;
    size_t all = (size_t)pass->blocks * (size_t)numbers * RF_BASIS_BLOCK;
    for (int b = 0; b < pass->blocks; ++b)
        for (int k = 0; k < numbers; ++k)
            for (int c = 0; c < RF_BASIS_BLOCK; ++c)
            {
                const float *image = pass->images + ((size_t)b * (size_t)numbers + (size_t)k) * RF_BASIS_BLOCK + c;
                double sum = 0;
                for (int part = 0; part < PARTS; ++part)
                    sum += (double)image[(size_t)part * all];
                vectors[(size_t)(b * RF_BASIS_BLOCK + c) * (size_t)numbers + (size_t)k] = sum;
            }
}

static void sort_columns(const double *variances, int columns, int *order)
{
    for (int i = 0; i < columns; ++i)
    {
        int slot = i;
        for (; slot > 0 && variances[i] > variances[order[slot - 1]]; --slot)
            order[slot] = order[slot - 1];
        order[slot] = i;
    }
}

void rf_principal_axes(double *covariance, int numbers, float *axes)
{
    assert(numbers >= 1 && numbers <= RF_BASIS_BLOCK);
    double vectors[RF_BASIS_BLOCK * RF_BASIS_BLOCK], along[RF_BASIS_BLOCK];
    int order[RF_BASIS_BLOCK];
    diagonalise(covariance, vectors, numbers);
    for (int i = 0; i < numbers; ++i)
        along[i] = covariance[i * numbers + i];
    sort_columns(along, numbers, order);
    for (int i = 0; i < numbers; ++i)
        for (int k = 0; k < numbers; ++k)
            axes[i * numbers + k] = (float)vectors[k * numbers + order[i]];
}

// B = B V, strongest first.
static void turn_basis(const Pass *pass, const Work *work, float *basis, double *variances, double *total)
{
    int columns = pass->blocks * RF_BASIS_BLOCK, numbers = pass->reader->numbers;
    double *gram = pass->gram, along[RF_BASIS_BLOCK * 8];
    int order[RF_BASIS_BLOCK * 8];
    *total = 0;
    for (int part = 0; part < PARTS; ++part)
    {
        for (int i = 0; part > 0 && i < columns * columns; ++i)
            gram[i] += gram[(size_t)part * (size_t)columns * (size_t)columns + (size_t)i];
        *total += pass->total[part];
    }
    diagonalise(gram, work->turn, columns);
    for (int i = 0; i < columns; ++i)
        along[i] = gram[i * columns + i];
    sort_columns(along, columns, order);
    for (int i = 0; i < columns; ++i)
    {
        variances[i] = fmax(along[order[i]], 0);
        float *out = basis + (size_t)(i / RF_BASIS_BLOCK) * (size_t)numbers * RF_BASIS_BLOCK + i % RF_BASIS_BLOCK;
        for (int k = 0; k < numbers; ++k)
        {
            double sum = 0;
            for (int j = 0; j < columns; ++j)
                sum += work->vectors[(size_t)j * (size_t)numbers + (size_t)k] * work->turn[j * columns + order[i]];
            out[(size_t)k * RF_BASIS_BLOCK] = (float)sum;
        }
    }
}

static void iterate(Pass *pass, const Work *work, float *basis, double *variances, double *total)
{
    int columns = pass->blocks * RF_BASIS_BLOCK, numbers = pass->reader->numbers;
    for (size_t i = 0; i < (size_t)columns * (size_t)numbers; ++i)
        work->vectors[i] = (double)rf_random_float(0, 0, i, 0) - 0.5;
    pass->basis = basis;
    for (int round = 0;; ++round)
    {
        make_orthonormal(work->vectors, columns, numbers);
        write_basis(work->vectors, pass->blocks, numbers, basis);
        rf_parallel_for(PARTS, pass_part, pass);
        if (round == ITERATIONS)
            break;
        add_images(pass, work->vectors);
    }
    turn_basis(pass, work, basis, variances, total);
}

RfResult rf_principal_components(const RfPanelReader *reader, int blocks, float *basis, double *variances,
                                 double *total)
{
    assert(blocks >= 1 && blocks <= 8);
    Pass pass = {.reader = reader, .blocks = blocks};
    Work work = {0};
    RfResult result = make_work(reader, blocks, &work, &pass);
    if (result == RF_OK)
        iterate(&pass, &work, basis, variances, total);
    rf_release(work.vectors);
    rf_release(work.turn);
    rf_release(work.sums);
    rf_release(work.memory);
    return result;
}
