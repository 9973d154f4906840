// The `frames` wire protocol of surgescope for a microcontroller: plain C++11, no library, no heap. The guide describes it on its page
// "Wire protocols"; tools/bridges/tests compiles this file on the computer and records what it sends.
#ifndef SURGESCOPE_FRAMES_H
#define SURGESCOPE_FRAMES_H

#include <stddef.h>
#include <stdint.h>

namespace surgescope {

// CRC-16/IBM-3740 of one more byte; it begins at 0xFFFF. Without a table and without a loop over bits.
inline uint16_t crc16(uint16_t crc, uint8_t byte) {
  crc = static_cast<uint16_t>((crc >> 8) | (crc << 8));
  crc = static_cast<uint16_t>(crc ^ byte);
  crc = static_cast<uint16_t>(crc ^ ((crc & 0xFF) >> 4));
  crc = static_cast<uint16_t>(crc ^ (crc << 12));
  return static_cast<uint16_t>(crc ^ ((crc & 0xFF) << 5));
}

// Gathers scans (a sample of each channel) into frames of SCANS and sends them. Scans are counted from the start of the device, from 0: a
// number that is left out becomes a gap in the recording. After 2^32 scans (49 days at 1 kHz) the device must be started anew.
template <uint8_t CHANNELS, uint16_t SCANS>
class Frames {
 public:
  // period_ns: time from scan to scan.
  explicit Frames(uint32_t period_ns) : period_ns_(period_ns), sequence_(0), first_(0), scans_(0) {}

  // Takes a scan. `out` has write(const uint8_t *, size_t), as Arduino's Serial has; it gets each frame that is full.
  template <class Out>
  void add(uint32_t scan, const int16_t *counts, Out &out) {
    const uint32_t expected = first_ + scans_;
    if (scan != expected) {
      flush(out);
      // As many numbers are left out as the lost scans would have filled frames.
      sequence_ = static_cast<uint16_t>(sequence_ + (scan - first_) / SCANS);
      first_ = scan;
    }
    uint8_t *at = body_ + HEADER + 2 * static_cast<size_t>(CHANNELS) * scans_;
    for (uint8_t channel = 0; channel < CHANNELS; ++channel, at += 2) put(at, static_cast<uint16_t>(counts[channel]), 2);
    if (++scans_ == SCANS) flush(out);
  }

  // Sends what does not fill a frame.
  template <class Out>
  void flush(Out &out) {
    if (scans_ == 0) return;
    const size_t length = HEADER + 2 * static_cast<size_t>(CHANNELS) * scans_;
    body_[0] = 1;
    body_[1] = CHANNELS;
    put(body_ + 2, sequence_, 2);
    put(body_ + 4, static_cast<uint64_t>(first_) * period_ns_ / 1000, 8);
    put(body_ + 12, period_ns_, 4);
    put(body_ + 16, scans_, 2);
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; ++i) crc = crc16(crc, body_[i]);
    put(body_ + length, crc, 2);
    stuff(length + 2, out);
    ++sequence_;
    first_ += scans_;
    scans_ = 0;
  }

 private:
  static const size_t HEADER = 18;

  static void put(uint8_t *to, uint64_t number, uint8_t bytes) {
    for (uint8_t i = 0; i < bytes; ++i, number >>= 8) to[i] = static_cast<uint8_t>(number);
  }

  // COBS: each block is preceded by the distance to the next zero; a zero ends the frame.
  template <class Out>
  void stuff(size_t length, Out &out) {
    size_t begin = 0;
    for (;;) {
      size_t end = begin;
      while (end < length && body_[end] != 0 && end - begin < 254) ++end;
      const uint8_t code = static_cast<uint8_t>(end - begin + 1);
      out.write(&code, 1);
      out.write(body_ + begin, end - begin);
      if (end >= length) break;
      // a full block stands for no zero
      begin = code == 255 ? end : end + 1;
    }
    const uint8_t zero = 0;
    out.write(&zero, 1);
  }

  uint32_t period_ns_;
  uint16_t sequence_;
  uint32_t first_;
  uint16_t scans_;
  uint8_t body_[HEADER + 2 * static_cast<size_t>(CHANNELS) * SCANS + 2];
};

}  // namespace surgescope

#endif
