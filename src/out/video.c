// SPDX-License-Identifier: Apache-2.0
// Video through the `ffmpeg` program, fed raw rgb24 frames. No shell is involved, and no library of ffmpeg's, whose
// packaged builds would put the whole binary under the GPL.
//
//   riffle ──▶ socket pair ──▶ ffmpeg (standard input) ──▶ .tmpPID.name.mp4 ──▶ renamed to name.mp4
//                              standard error ──▶ a file in memory, whose last line goes into the message
//
// The channel is a socket pair and no pipe, because a send can be told not to raise SIGPIPE when ffmpeg has died,
// without touching the program's signals. ffmpeg runs in a process group of its own: Ctrl-C reaches the caller alone,
// which then decides whether to keep the file.
//
// The same frames give the same file: ffmpeg's threads are a fixed number (x264's result depends on it), and dates and
// versions are left out.
#include "riffle/io.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "out/file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

enum
{
    MAX_ARGUMENTS = 64,
    MAX_ENCODERS = 2
};

// yuv420p in the colours of HD video, said in the file, so that a player shows what the frames have.
#define YUV_FILTER "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int,format=yuv420p"
#define YUV_TAGS "-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709", "-color_range", "tv"
#define GIF_FILTER "split[a][b];[a]palettegen=stats_mode=full[p];[b][p]paletteuse=dither=bayer:bayer_scale=4"

typedef struct VideoEncoder
{
    // NULL: part of every ffmpeg, not looked for.
    const char *name;
    const char *arguments[24];
} VideoEncoder;

typedef struct VideoFormat
{
    const char *extension;
    bool even;
    // The first that this ffmpeg has is taken.
    VideoEncoder encoders[MAX_ENCODERS];
} VideoFormat;

#define X264                                                                                                           \
    {                                                                                                                  \
        "libx264",                                                                                                     \
        {                                                                                                              \
            "-vf", YUV_FILTER, YUV_TAGS, "-c:v", "libx264", "-preset", "veryfast", "-crf", "18", "-movflags",          \
                "+faststart"                                                                                           \
        }                                                                                                              \
    }
#define MPEG4                                                                                                          \
    {                                                                                                                  \
        NULL,                                                                                                          \
        {                                                                                                              \
            "-vf", YUV_FILTER, YUV_TAGS, "-c:v", "mpeg4", "-q:v", "3", "-movflags", "+faststart"                       \
        }                                                                                                              \
    }

static const VideoFormat g_formats[] = {
    {"mp4", true, {X264, MPEG4}},
    {"mov", true, {X264, MPEG4}},
    {"webm",
     true,
     {{"libvpx-vp9",
       {"-vf", YUV_FILTER, YUV_TAGS, "-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-deadline", "realtime",
        "-cpu-used", "6", "-row-mt", "1"}},
      {NULL,
       {"-vf", YUV_FILTER, YUV_TAGS, "-c:v", "libvpx", "-crf", "10", "-b:v", "8M", "-deadline", "realtime", "-cpu-used",
        "6"}}}},
    {"gif", false, {{NULL, {"-filter_complex", GIF_FILTER, "-loop", "0"}}}},
};

struct RfVideo
{
    char path[PATH_MAX];
    char temporary[PATH_MAX + 64];
    // Of the frames, and of the video, which has even sides where the format wants it.
    int width, height, padded_width, padded_height;
    uint8_t *pixels;
    size_t size;
    // Our end of the socket pair, ffmpeg's messages, and its process; -1 and 0 where there is none.
    int channel, messages;
    pid_t process;
    int frames;
    // Of the first failure; the video is lost with it.
    RfResult result;
};

// ---- the program ---------------------------------------------------------------------------------------------------

// Starts ffmpeg with three descriptors for its standard ones; returns errno.
static int start(const char *const arguments[], int input, int output, int errors, pid_t *process)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t restored, blocked;
    sigemptyset(&blocked);
    sigemptyset(&restored);
    sigaddset(&restored, SIGPIPE);
    sigaddset(&restored, SIGINT);
    sigaddset(&restored, SIGTERM);
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, 0);
    posix_spawn_file_actions_adddup2(&actions, output, 1);
    posix_spawn_file_actions_adddup2(&actions, errors, 2);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setsigdefault(&attributes, &restored);
    posix_spawnattr_setsigmask(&attributes, &blocked);
    int code = posix_spawnp(process, "ffmpeg", &actions, &attributes, (char *const *)(uintptr_t)arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    return code;
}

// True if the program ended well.
static bool wait_for(pid_t process)
{
    int status = 0;
    while (waitpid(process, &status, 0) < 0)
    {
        if (errno != EINTR)
            return false;
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static RfResult fail_start(const char *path, int code)
{
    if (code == ENOENT || code == EACCES)
        return rf_fail(RF_UNSUPPORTED, path, NULL,
                       "video needs the ffmpeg program, which is not in the PATH: install it (apt install ffmpeg), or "
                       "write frames as name.%%04d.png");
    return rf_fail(RF_WRITE_FAILED, path, NULL, "ffmpeg cannot be started: %s", strerror(code));
}

// True if ffmpeg's list of encoders, in memory at `list`, has the name as a word.
static bool has_encoder(const char *list, const char *name)
{
    size_t length = strlen(name);
    for (const char *p = list; (p = strstr(p, name)) != NULL; p += length)
    {
        if (p > list && p[-1] == ' ' && p[length] == ' ')
            return true;
    }
    return false;
}

// Picks the format's first encoder that this ffmpeg has; the last is taken unseen.
static RfResult pick_encoder(const char *path, const VideoFormat *format, const VideoEncoder **out)
{
    static const char *const arguments[] = {"ffmpeg", "-hide_banner", "-nostdin", "-encoders", NULL};
    *out = &format->encoders[0];
    if (!format->encoders[0].name)
        return RF_OK;
    int null = open("/dev/null", O_RDWR | O_CLOEXEC), list = memfd_create("encoders", MFD_CLOEXEC);
    pid_t process = 0;
    int code = null >= 0 && list >= 0 ? start(arguments, null, list, null, &process) : errno;
    RfResult result = code == 0 ? RF_OK : fail_start(path, code);
    if (code == 0 && wait_for(process))
    {
        char text[65536];
        ssize_t length = pread(list, text, sizeof text - 1, 0);
        text[length > 0 ? length : 0] = '\0';
        if (!has_encoder(text, format->encoders[0].name))
            *out = &format->encoders[1];
    }
    if (null >= 0)
        close(null);
    if (list >= 0)
        close(list);
    return result;
}

// The last line that ffmpeg wrote.
static void last_message(const RfVideo *video, char *line, size_t size)
{
    char text[4096];
    off_t end = lseek(video->messages, 0, SEEK_END);
    off_t from = end > (off_t)sizeof text - 1 ? end - (off_t)sizeof text + 1 : 0;
    ssize_t length = pread(video->messages, text, sizeof text - 1, from);
    length = length > 0 ? length : 0;
    while (length > 0 && (text[length - 1] == '\n' || text[length - 1] == '\r'))
        --length;
    text[length] = '\0';
    const char *newline = strrchr(text, '\n');
    snprintf(line, size, "%.*s", (int)size - 1, newline ? newline + 1 : text);
    if (line[0] == '\0')
        snprintf(line, size, "it gave no reason");
}

// ---- opening -------------------------------------------------------------------------------------------------------

static const VideoFormat *format_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    const char *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof g_formats / sizeof g_formats[0]; ++i)
    {
        if (strcasecmp(dot + 1, g_formats[i].extension) == 0)
            return &g_formats[i];
    }
    return NULL;
}

// The place is tried before ffmpeg runs, for a message of our own.
static RfResult try_place(const RfVideo *video)
{
    int file = open(video->temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0)
        return rf_fail(RF_WRITE_FAILED, video->path, NULL, "cannot be written: %s", strerror(errno));
    close(file);
    return RF_OK;
}

static RfResult start_encoder(RfVideo *video, const VideoFormat *format, const VideoEncoder *encoder, float fps)
{
    char size[32], rate[32], output[PATH_MAX + 72];
    snprintf(size, sizeof size, "%dx%d", video->padded_width, video->padded_height);
    snprintf(rate, sizeof rate, "%ld/1000", lroundf(fps * 1000));
    // "file:" keeps a name with a colon from being taken for a protocol.
    snprintf(output, sizeof output, "file:%s", video->temporary);
    const char *const before[] = {"ffmpeg",      "-hide_banner", "-nostdin",   "-xerror",  "-nostats", "-loglevel",
                                  "error",       "-y",           "-f",         "rawvideo", "-pix_fmt", "rgb24",
                                  "-video_size", size,           "-framerate", rate,       "-i",       "pipe:0"};
    const char *const after[] = {"-an",      "-threads",  "4",  "-map_metadata",   "-1",  "-fflags", "+bitexact",
                                 "-flags:v", "+bitexact", "-f", format->extension, output};
    const char *arguments[MAX_ARGUMENTS];
    int count = 0;
    for (size_t i = 0; i < sizeof before / sizeof before[0]; ++i)
        arguments[count++] = before[i];
    for (const char *const *a = encoder->arguments; *a; ++a)
        arguments[count++] = *a;
    for (size_t i = 0; i < sizeof after / sizeof after[0]; ++i)
        arguments[count++] = after[i];
    arguments[count] = NULL;
    assert(count < MAX_ARGUMENTS);

    int pair[2] = {-1, -1};
    video->messages = memfd_create("messages", MFD_CLOEXEC);
    if (video->messages < 0 || socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0)
        return rf_fail(RF_WRITE_FAILED, video->path, NULL, "ffmpeg cannot be started: %s", strerror(errno));
    int code = start(arguments, pair[1], video->messages, video->messages, &video->process);
    close(pair[1]);
    video->channel = pair[0];
    return code == 0 ? RF_OK : fail_start(video->path, code);
}

static RfResult open_video(RfVideo *video, const VideoFormat *format, float fps)
{
    const VideoEncoder *encoder;
    RF_TRY(rf_out_temporary_name(video->path, video->temporary, sizeof video->temporary));
    video->size = (size_t)video->padded_width * (size_t)video->padded_height * 3;
    video->pixels = rf_allocate(video->size, 1);
    if (!video->pixels)
        return RF_OUT_OF_MEMORY;
    RF_TRY(pick_encoder(video->path, format, &encoder));
    RF_TRY(try_place(video));
    return start_encoder(video, format, encoder, fps);
}

RfResult rf_video_open(const char *path, int width, int height, float fps, RfVideo **out)
{
    RF_REQUIRE(path && out, "rf_video_open: NULL argument");
    *out = NULL;
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "rf_video_open: %d x %d pixels: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    RF_REQUIRE(fps >= 0.1f && fps <= 1000, "rf_video_open: %g frames a second: must be 0.1 to 1000", (double)fps);
    const VideoFormat *format = format_of(path);
    if (!format)
        return rf_fail(RF_UNSUPPORTED, path, NULL, "video is written as .mp4, .webm, .mov or .gif; name it so");
    if (strlen(path) >= PATH_MAX)
        return rf_fail(RF_WRITE_FAILED, path, NULL, "the name is too long");
    RfVideo *video = rf_allocate_zero(1, sizeof *video);
    if (!video)
        return RF_OUT_OF_MEMORY;
    strcpy(video->path, path);
    video->width = width;
    video->height = height;
    video->padded_width = width + (format->even ? width & 1 : 0);
    video->padded_height = height + (format->even ? height & 1 : 0);
    video->channel = video->messages = -1;
    video->result = open_video(video, format, fps);
    if (video->result != RF_OK)
        return rf_video_close(video, false);
    *out = video;
    return RF_OK;
}

// ---- frames --------------------------------------------------------------------------------------------------------

static uint8_t to_byte(float x)
{
    return (uint8_t)(rf_clamp(x, 0, 1) * 255.0f + 0.5f);
}

// The last row and column are repeated where the video is larger by one.
static void convert(RfVideo *video, const RfImageView *frame)
{
    bool colour = frame->channels >= 3;
    uint8_t *to = video->pixels;
    for (int y = 0; y < video->padded_height; ++y)
    {
        const float *row = frame->pixels + (ptrdiff_t)rf_min_int(y, frame->height - 1) * frame->row_stride;
        for (int x = 0; x < video->padded_width; ++x, to += 3)
        {
            const float *pixel = row + (ptrdiff_t)rf_min_int(x, frame->width - 1) * frame->channels;
            float alpha = frame->channels == 4 ? rf_clamp(pixel[3], 0, 1) : 1;
            for (int c = 0; c < 3; ++c)
                to[c] = to_byte(pixel[colour ? c : 0] * alpha);
        }
    }
}

static RfResult fail_encoder(RfVideo *video)
{
    char line[512];
    close(video->channel);
    video->channel = -1;
    // It may have closed its input and still be running.
    kill(video->process, SIGTERM);
    wait_for(video->process);
    video->process = 0;
    last_message(video, line, sizeof line);
    return rf_fail(RF_WRITE_FAILED, video->path, NULL, "ffmpeg stopped: %s", line);
}

static RfResult send_pixels(RfVideo *video)
{
    size_t done = 0;
    while (done < video->size)
    {
        ssize_t sent = send(video->channel, video->pixels + done, video->size - done, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent < 0)
            return fail_encoder(video);
        done += (size_t)sent;
    }
    return RF_OK;
}

RfResult rf_video_write(RfVideo *video, const RfImageView *frame)
{
    RF_REQUIRE(video && frame && frame->pixels, "rf_video_write: NULL argument");
    RF_REQUIRE(frame->width == video->width && frame->height == video->height,
               "rf_video_write: the frame has %d x %d pixels, the video %d x %d", frame->width, frame->height,
               video->width, video->height);
    RF_REQUIRE(frame->channels == 1 || frame->channels == 3 || frame->channels == 4,
               "rf_video_write: %d channels: must be 1, 3 or 4", frame->channels);
    if (video->result != RF_OK)
        return rf_fail(video->result, video->path, NULL, "ffmpeg has stopped already");
    convert(video, frame);
    video->result = send_pixels(video);
    ++video->frames;
    return video->result;
}

// ---- closing -------------------------------------------------------------------------------------------------------

// Lets ffmpeg finish the file, flushes it to the disk and gives it its name.
static RfResult finish(RfVideo *video)
{
    RF_REQUIRE(video->frames > 0, "rf_video_close: the video has no frame");
    close(video->channel);
    video->channel = -1;
    bool well = wait_for(video->process);
    video->process = 0;
    if (!well)
    {
        char line[512];
        last_message(video, line, sizeof line);
        return rf_fail(RF_WRITE_FAILED, video->path, NULL, "ffmpeg failed: %s", line);
    }
    int file = open(video->temporary, O_RDONLY | O_CLOEXEC);
    bool written = file >= 0 && fsync(file) == 0;
    if (file >= 0)
        close(file);
    if (!written || rename(video->temporary, video->path) != 0)
        return rf_fail(RF_WRITE_FAILED, video->path, NULL, "cannot be written: %s", strerror(errno));
    return RF_OK;
}

RfResult rf_video_close(RfVideo *video, bool keep)
{
    if (!video)
        return RF_OK;
    RfResult result = video->result;
    if (keep && result == RF_OK)
        result = finish(video);
    if (video->process > 0)
    {
        kill(video->process, SIGKILL);
        wait_for(video->process);
    }
    if (video->channel >= 0)
        close(video->channel);
    if (video->messages >= 0)
        close(video->messages);
    // After a rename there is nothing of that name.
    if (video->temporary[0] != '\0')
        unlink(video->temporary);
    rf_release(video->pixels);
    rf_release(video);
    return result;
}
