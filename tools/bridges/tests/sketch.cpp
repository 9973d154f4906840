// The Arduino sketch on the computer, on a board of a few lines whose clock stands just before it begins anew and whose converter shows
// the scan that is due; it is held up for 55 ms once.
#include <cstdint>
#include <cstdio>

static const uint8_t A0 = 14, A1 = 15, A2 = 16;
static uint32_t now_us = 0xFFFFFFFFu - 500000u;
static const uint32_t started_us = now_us;
static uint32_t micros() { return now_us += 4; }
static int analogRead(uint8_t pin) {
  now_us += 112;
  const uint32_t scan = (now_us - started_us) / 1000;
  return static_cast<int>((scan * (pin == A0 ? 1 : pin == A1 ? 3 : 7)) % 1024);
}
struct Board {
  void begin(uint32_t) {}
  size_t write(const uint8_t *bytes, size_t length) { return fwrite(bytes, 1, length, stdout); }
};
static Board Serial;

#include "../arduino/surgescope_frames/surgescope_frames.ino"

int main() {
  setup();
  bool held_up = false;
  while (now_us - started_us < 2000000u) {
    if (!held_up && now_us - started_us > 1000000u) {
      now_us += 55000;
      held_up = true;
    }
    loop();
  }
  frames.flush(Serial);
  return 0;
}
