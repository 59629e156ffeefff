// SPDX-License-Identifier: Apache-2.0
// A program against the installed library: prints its version, makes an exemplar, and meets a failure with a message.
#include <riffle/riffle.h>

#include <stdio.h>

int main(void)
{
    printf("%s\n", rf_version());
    RfImage *image = NULL;
    if (rf_image_create(64, 64, 3, &image) != RF_OK)
        return 1;
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    RfExemplar *exemplar = NULL;
    RfResult made = rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar);
    bool fits = made == RF_OK && rf_exemplar_width(exemplar) == 64 && rf_exemplar_channels(exemplar) == 3;
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);

    RfResult missing = rf_image_read("no such picture.png", &image);
    printf("%s: %s\n", rf_last_error()->file, rf_last_error()->message);
    return fits && missing == RF_UNREADABLE && rf_lagrangian_defaults().struct_size != 0 ? 0 : 1;
}
