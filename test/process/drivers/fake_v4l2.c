/* A camera of Video4Linux for programs that are started with this library in LD_PRELOAD: the kernel of a test machine
   may have no module for one. Its device is an ordinary file, whose pages are the buffers; only ioctl and select on it
   are answered here, so OpenCV's and our own code run as with a real camera.

   FAKE_V4L2 is the path of its devices without their number. Beside them lie: DEVICE.frames/N.jpg, the pictures; DEVICE.log, which gets "frame N SECONDS"
   and "control ID VALUE"; DEVICE.busy: another program has it; DEVICE.silent: no picture comes. A device that was
   removed was unplugged. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { BUFFERS = 4, BUFFER_SIZE = 1 << 20 };
static const double PERIOD = 1.0 / 30.0;

static struct v4l2_pix_format format = {.width = 640, .height = 480, .pixelformat = V4L2_PIX_FMT_MJPEG};
static int queue[BUFFERS], queued;
static unsigned sequence;
static double due;
static int value_of_exposure_auto = 3;

static double steady(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec + now.tv_nsec * 1e-9;
}

static int beside(const char *ending, char *path, size_t size) {
  snprintf(path, size, "%s%s", getenv("FAKE_V4L2"), ending);
  return access(path, F_OK) == 0;
}

static int is_device(int file, int *is_gone) {
  struct stat here;
  char link[64], path[512];
  const char *device = getenv("FAKE_V4L2");
  if (!device || fstat(file, &here) || !S_ISREG(here.st_mode)) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = 0;
  if (strncmp(path, device, strlen(device)) || path[strlen(device)] < '0' || path[strlen(device)] > '9') return 0;
  *is_gone = here.st_nlink == 0;
  return 1;
}

static void note(const char *kind, unsigned number, double value) {
  char path[512];
  beside(".log", path, sizeof path);
  FILE *log = fopen(path, "a");
  if (!log) return;
  fprintf(log, "%s %u %.6f\n", kind, number, value);
  fclose(log);
}

static int fail(int code) {
  errno = code;
  return -1;
}

static int take_picture(int file, struct v4l2_buffer *buffer) {
  char path[512], ending[64];
  static unsigned char data[BUFFER_SIZE];
  size_t length = format.width * format.height * 2;
  double now = steady();
  if (beside(".silent", path, sizeof path) || !queued || now < due) return fail(EAGAIN);
  due = due + PERIOD < now ? now + PERIOD : due + PERIOD;
  snprintf(ending, sizeof ending, ".frames/%u.jpg", sequence);
  if (!beside(ending, path, sizeof path)) {
    sequence = 0;
    beside(".frames/0.jpg", path, sizeof path);
  }
  if (format.pixelformat == V4L2_PIX_FMT_MJPEG) {
    FILE *picture = fopen(path, "rb");
    if (!picture) return fail(EIO);
    length = fread(data, 1, sizeof data, picture);
    fclose(picture);
  } else {
    for (size_t i = 0; i < length; i++) data[i] = i % 2 ? 128 : 200; /* grey: Y 200, U and V 128 */
  }
  int index = queue[0];
  memmove(queue, queue + 1, sizeof queue - sizeof *queue);
  queued--;
  if (pwrite(file, data, length, (off_t)index * BUFFER_SIZE) < 0) return -1;
  buffer->index = index;
  buffer->length = BUFFER_SIZE;
  buffer->bytesused = length;
  buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  buffer->sequence = sequence;
  buffer->timestamp.tv_sec = (time_t)now;
  buffer->timestamp.tv_usec = (suseconds_t)((now - (double)(time_t)now) * 1e6);
  note("frame", sequence++, now);
  return 0;
}

static int answer(int file, unsigned long request, void *data) {
  char path[512];
  switch (request) {
    case VIDIOC_QUERYCAP: {
      struct v4l2_capability *to = data;
      memset(to, 0, sizeof *to);
      strcpy((char *)to->driver, "uvcvideo");
      strcpy((char *)to->card, "Test Camera");
      to->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      to->capabilities = to->device_caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_ENUMINPUT:
      return ((struct v4l2_input *)data)->index ? fail(EINVAL) : 0;
    case VIDIOC_G_INPUT:
      *(int *)data = 0;
      return 0;
    case VIDIOC_S_INPUT:
      return 0;
    case VIDIOC_G_FMT:
    case VIDIOC_S_FMT:
    case VIDIOC_TRY_FMT: {
      struct v4l2_pix_format *to = &((struct v4l2_format *)data)->fmt.pix;
      if (request != VIDIOC_G_FMT) {
        if (to->pixelformat == V4L2_PIX_FMT_MJPEG || to->pixelformat == V4L2_PIX_FMT_YUYV)
          format.pixelformat = to->pixelformat;
        if (to->width && to->height) format.width = to->width, format.height = to->height;
      }
      format.field = V4L2_FIELD_NONE;
      format.bytesperline = format.pixelformat == V4L2_PIX_FMT_MJPEG ? 0 : format.width * 2;
      format.sizeimage = format.pixelformat == V4L2_PIX_FMT_MJPEG ? BUFFER_SIZE : format.width * format.height * 2;
      *to = format;
      return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      struct v4l2_captureparm *to = &((struct v4l2_streamparm *)data)->parm.capture;
      to->capability = V4L2_CAP_TIMEPERFRAME;
      to->timeperframe.numerator = 1;
      to->timeperframe.denominator = 30;
      return 0;
    }
    case VIDIOC_REQBUFS: {
      struct v4l2_requestbuffers *to = data;
      if (beside(".busy", path, sizeof path)) return fail(EBUSY);
      if (to->memory != V4L2_MEMORY_MMAP) return fail(EINVAL);
      to->count = to->count ? BUFFERS : 0;
      queued = 0;
      return 0;
    }
    case VIDIOC_QUERYBUF: {
      struct v4l2_buffer *to = data;
      to->length = BUFFER_SIZE;
      to->m.offset = to->index * BUFFER_SIZE;
      return 0;
    }
    case VIDIOC_QBUF:
      if (queued < BUFFERS) queue[queued++] = ((struct v4l2_buffer *)data)->index;
      return 0;
    case VIDIOC_DQBUF:
      return take_picture(file, data);
    case VIDIOC_STREAMON:
      due = steady();
      return 0;
    case VIDIOC_STREAMOFF:
      queued = 0;
      return 0;
    case VIDIOC_QUERYCTRL: {
      struct v4l2_queryctrl *to = data;
      if (to->id != V4L2_CID_BRIGHTNESS && to->id != V4L2_CID_EXPOSURE_AUTO) return fail(EINVAL);
      to->minimum = 0;
      to->maximum = 255;
      to->step = 1;
      return 0;
    }
    case VIDIOC_G_CTRL:
      ((struct v4l2_control *)data)->value = value_of_exposure_auto;
      return 0;
    case VIDIOC_S_CTRL:
      note("control", ((struct v4l2_control *)data)->id & 0xFFFF, ((struct v4l2_control *)data)->value);
      return 0;
    default:
      return fail(EINVAL);
  }
}

int ioctl(int file, unsigned long request, ...) {
  static int (*real)(int, unsigned long, void *);
  va_list arguments;
  int is_gone;
  va_start(arguments, request);
  void *data = va_arg(arguments, void *);
  va_end(arguments);
  if (_IOC_TYPE(request) == 'V' && is_device(file, &is_gone)) return is_gone ? fail(ENODEV) : answer(file, request, data);
  if (!real) real = (int (*)(int, unsigned long, void *))dlsym(RTLD_NEXT, "ioctl");
  return real(file, request, data);
}

int select(int count, fd_set *reads, fd_set *writes, fd_set *errors, struct timeval *limit) {
  static int (*real)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
  int is_gone;
  char path[512];
  if (reads && limit && count > 0 && FD_ISSET(count - 1, reads) && is_device(count - 1, &is_gone)) {
    double until = steady() + limit->tv_sec + limit->tv_usec * 1e-6;
    while (steady() < until) {
      is_device(count - 1, &is_gone);
      if (is_gone || (!beside(".silent", path, sizeof path) && steady() >= due)) return 1;
      usleep(1000);
    }
    return 0;
  }
  if (!real) real = (int (*)(int, fd_set *, fd_set *, fd_set *, struct timeval *))dlsym(RTLD_NEXT, "select");
  return real(count, reads, writes, errors, limit);
}
