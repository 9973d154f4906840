"""Writes tests/fixtures/openpyxl.xlsx and openpyxl-two.xlsx: tables that openpyxl wrote, with times as dates of Excel, and with dates and
times of the day in two columns; openpyxl-1904.xlsx, whose days count from 1904; and openpyxl-sheets.xlsx, whose table goes on in other sheets.
Needs openpyxl."""

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

book = openpyxl.Workbook()
book.epoch = openpyxl.utils.datetime.CALENDAR_MAC_1904
book.active.append(["Date", "Pressure 1 (bar)", "Pressure 2 (bar)"])
for i in range(60):
    book.active.append([start + datetime.timedelta(milliseconds=5 * i), 1.5 + 0.01 * i, 1.2])
book.save(Path(__file__).parent.parent / "tests/fixtures/openpyxl-1904.xlsx")

# Settings, three sheets of one table (the headings repeated in the second, not in the third), and a table of something else.
book = openpyxl.Workbook()
book.active.title = "settings"
for row in [["Rig", 7], ["Operator", "Kim"], ["Rate, Hz", 200, 200], ["Sensor", "P1", "P2"], ["Place, m", 100, 60]]:
    book.active.append(row)
headings = ["Time (s)", "Pressure 1 (bar)", "Pressure 2 (bar)"]
for name, rows in [("data", range(0, 30)), ("data 2", range(30, 50)), ("data 3", range(50, 60))]:
    sheet = book.create_sheet(name)
    if name != "data 3":
        sheet.append(headings)
    for i in rows:
        sheet.append([0.005 * i, 1.5 + 0.01 * i, 1.2])
sheet = book.create_sheet("second run")
sheet.append(headings)
for i in range(20):
    sheet.append([0.005 * i, 2.5, 1.9])
book.save(Path(__file__).parent.parent / "tests/fixtures/openpyxl-sheets.xlsx")
