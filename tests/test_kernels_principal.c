// SPDX-License-Identifier: Apache-2.0
#include "core/random.h"
#include "kernels/principal.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

enum
{
    VECTORS = 500,
    LENGTH = 70
};

static float g_vectors[VECTORS][LENGTH];

static void read_vectors(const void *context, int item, float *panel)
{
    (void)context;
    for (int k = 0; k < LENGTH; ++k)
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            panel[k * RF_TILE_QUERIES + q] = item + q < VECTORS ? g_vectors[item + q][k] : 0;
}

static void the_basis_is_orthonormal_and_finds_what_was_put_in(void **state)
{
    (void)state;
    // 40 directions of falling strength: cosines, which are orthogonal.
    for (int i = 0; i < VECTORS; ++i)
        for (int k = 0; k < LENGTH; ++k)
        {
            g_vectors[i][k] = 0;
            for (int m = 0; m < 40; ++m)
                g_vectors[i][k] += powf(0.8f, (float)m) * (rf_random_float(8, 0, (uint64_t)i, (uint64_t)m) - 0.5f) *
                                   cosf(3.14159265f * (float)m * ((float)k + 0.5f) / LENGTH);
        }
    _Alignas(64) static float basis[LENGTH * 32];
    double variances[32], total;
    RfPanelReader reader = {read_vectors, NULL, VECTORS, LENGTH};
    assert_int_equal(rf_principal_components(&reader, 1, basis, variances, &total), RF_OK);
    double held = 0;
    for (int a = 0; a < 32; ++a)
    {
        for (int b = 0; b < 32; ++b)
        {
            double product = 0;
            for (int k = 0; k < LENGTH; ++k)
                product += (double)basis[k * 32 + a] * (double)basis[k * 32 + b];
            assert_true(fabs(product - (a == b)) < 1e-5);
        }
        assert_true(a == 0 || variances[a] <= variances[a - 1]);
        held += variances[a];
    }
    // The first 32 of 40 directions hold all but 0.8^64 / (1 - 0.8^2) of it.
    assert_true(held > 0.99999 * total && held <= total * (1 + 1e-6));
}

static void what_the_vectors_do_not_span_holds_no_variance(void **state)
{
    (void)state;
    for (int i = 0; i < VECTORS; ++i)
        for (int k = 0; k < LENGTH; ++k)
            g_vectors[i][k] = (float)(i % 7) * (float)(k == 3) + (float)(i % 5) * (float)(k == 50);
    _Alignas(64) static float basis[LENGTH * 32];
    double variances[32], total;
    RfPanelReader reader = {read_vectors, NULL, VECTORS, LENGTH};
    assert_int_equal(rf_principal_components(&reader, 1, basis, variances, &total), RF_OK);
    assert_true(fabs(variances[0] + variances[1] - total) < 1e-5 * total);
    for (int a = 2; a < 32; ++a)
        assert_true(variances[a] < 1e-9 * total);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_basis_is_orthonormal_and_finds_what_was_put_in),
        cmocka_unit_test(what_the_vectors_do_not_span_holds_no_variance),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
