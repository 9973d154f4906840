// The Arduino's encoder on the computer: sends what its arguments say, from numbers that a test knows.
//   host 1|42 SCANS [FROM COUNT]…   sends SCANS scans of 3 channels, so many a frame, and leaves out COUNT scans from scan FROM on
#include "../arduino/surgescope_frames/frames.h"

#include <cstdio>
#include <cstdlib>

struct Out {
  size_t write(const uint8_t *bytes, size_t length) { return fwrite(bytes, 1, length, stdout); }
};

// Every 16-bit number comes up, zeros and long runs without one among them.
static int16_t count(uint32_t channel, uint32_t scan) {
  static const int32_t slopes[] = {1, 3, -7};
  if (scan / 1000 % 2) return static_cast<int16_t>(0x0101 * (channel + 1));
  return static_cast<int16_t>(static_cast<uint16_t>(slopes[channel] * static_cast<int32_t>(scan)));
}

static uint32_t number(const char *word) { return static_cast<uint32_t>(strtoul(word, nullptr, 10)); }

// At 5 kHz.
template <uint16_t SCANS>
static void run(int argc, char **argv) {
  surgescope::Frames<3, SCANS> frames(1000000 / 5);
  Out out;
  const uint32_t scans = number(argv[2]);
  for (uint32_t scan = 0; scan < scans; ++scan) {
    bool lost = false;
    for (int i = 3; i + 1 < argc; i += 2) {
      const uint32_t from = number(argv[i]);
      lost = lost || (scan >= from && scan - from < number(argv[i + 1]));
    }
    const int16_t counts[3] = {count(0, scan), count(1, scan), count(2, scan)};
    if (!lost) frames.add(scan, counts, out);
  }
  frames.flush(out);
}

int main(int argc, char **argv) {
  // 42 scans of 3 channels and the check sum fill a block of 254 bytes
  if (number(argv[1]) == 1) run<1>(argc, argv);
  else run<42>(argc, argv);
  return 0;
}
