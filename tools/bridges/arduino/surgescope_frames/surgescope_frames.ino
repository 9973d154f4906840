// Sends analog inputs as surgescope's `frames`. Set the four constants, load it, and write into the rig file:
//
//   [[device]]
//   name = "daq"
//   port = "/dev/ttyACM0"
//   baud = 1000000
//   protocol = "frames"
//
// A count is a step of the converter: on an Uno 5 V / 1024, so `scale` = (sensor's unit per volt) x 0.0048828.
#include "frames.h"

const uint8_t PINS[] = {A0, A1, A2};
const uint32_t PERIOD_US = 1000;  // an Uno converts a channel in 112 us: three take 340 us of it
const uint16_t SCANS = 10;        // a frame, so that one leaves each 10 ms
const uint32_t BAUD = 1000000;

const uint8_t CHANNELS = sizeof(PINS);
surgescope::Frames<CHANNELS, SCANS> frames(PERIOD_US * 1000UL);
uint32_t scan = 0;
uint32_t due_us;

void setup() {
  Serial.begin(BAUD);
  due_us = micros();
}

void loop() {
  // The difference of two times is right when micros() begins anew after 71 minutes.
  if (static_cast<int32_t>(micros() - due_us) < 0) return;
  // Scans that fell out because something took too long are left out, so that the recording has a gap there.
  const uint32_t missed = (micros() - due_us) / PERIOD_US;
  scan += missed;
  due_us += missed * PERIOD_US;
  int16_t counts[CHANNELS];
  for (uint8_t i = 0; i < CHANNELS; ++i) counts[i] = static_cast<int16_t>(analogRead(PINS[i]));
  frames.add(scan, counts, Serial);
  ++scan;
  due_us += PERIOD_US;
}
