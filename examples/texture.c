// SPDX-License-Identifier: Apache-2.0
// A river of foam, in 24 frames: what `riffle texture builtin:river builtin:foam river.%04d.png --frames 1-24` does.
// The lines between the marks stand in README.md, too; a test compares them.
#include <riffle/riffle.h>

#include <stdio.h>
#include <stdlib.h>

static void check(bool failed)
{
    if (!failed)
        return;
    const RfError *error = rf_last_error();
    fprintf(stderr, "texture: %s %s %s\n", error->file, error->place, error->message);
    exit(1);
}

static const char *file_name(int n)
{
    static char name[32];
    snprintf(name, sizeof name, "river.%04d.png", n);
    return name;
}

int main(void)
{
    RfFlow *flow = NULL;
    RfFlowView moment;
    RfImage *foam = NULL, *frame = NULL;
    RfExemplar *exemplar = NULL;
    RfLagrangian *lagrangian = NULL;
    RfLagrangianOptions options = rf_lagrangian_defaults();
    // The size of the river's default, or any other: the frame covers it all.
    check(rf_image_create(512, 256, 3, &frame));
    RfImageView pixels = rf_image_view(frame);
    rf_image_set_origin(frame, RF_SAMPLE_U8, RF_ENCODING_SRGB);

    // README begins
    check(rf_flow_open("builtin:river", NULL, &flow));
    check(rf_image_read("builtin:foam", &foam));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(foam), 1};
    check(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar));
    check(rf_lagrangian_create(exemplar, &options, &lagrangian));
    for (int n = 1; n <= 24; ++n)
        check(rf_flow_at(flow, n, &moment) || rf_lagrangian_step(lagrangian, &moment, &pixels) ||
              rf_image_write(file_name(n), frame));
    // README ends

    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(frame);
    rf_image_destroy(foam);
    rf_flow_close(flow);
    return 0;
}
