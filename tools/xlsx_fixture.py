"""Writes tests/fixtures/openpyxl.xlsx and openpyxl-two.xlsx: tables that openpyxl wrote, with times as dates of Excel, and with dates and
times of the day in two columns. Needs openpyxl."""

import datetime
from pathlib import Path

import openpyxl

book = openpyxl.Workbook()
book.active.title = "about"
book.active.append(["Rig 7"])
sheet = book.create_sheet("data")
sheet.append(["Date", "Pressure 1 (bar)", "Pressure 2 (bar)"])
start = datetime.datetime(2026, 3, 14, 9, 26, 53)
for i in range(60):
    sheet.append([start + datetime.timedelta(milliseconds=5 * i), 1.5 + 0.01 * i, 1.2])
book.save(Path(__file__).parent.parent / "tests/fixtures/openpyxl.xlsx")

book = openpyxl.Workbook()
book.active.append(["Run", "Date", "Time", "Pressure 1 (bar)", "Pressure 2 (bar)"])
for i in range(60):
    at = start + datetime.timedelta(milliseconds=5 * i)
    book.active.append([7, at.date(), at.time(), 1.5 + 0.01 * i, 1.2])
book.save(Path(__file__).parent.parent / "tests/fixtures/openpyxl-two.xlsx")
