"""A fake of LabJack's package; see tests/fakes/fake_device.py."""
