"""PDFs as a ruler and a scanner see them."""

import ctypes

import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium

MM = 72 / 25.4


def pictures_mm(path):
    """Each page's picture: where it lies on the page, (left, bottom, right, top) [mm], and its grey values."""
    found = []
    document = pypdfium2.PdfDocument(path)
    for page in document:
        (image,) = page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_IMAGE])
        found.append((np.array(image.get_bounds()) / MM, image.get_bitmap().to_numpy().squeeze().copy()))
    document.close()
    return found


def lines_mm(page):
    """The ends of every line that is drawn: (x0, y0, x1, y1) [mm]."""
    found = []
    for path in page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH]):
        ends = []
        for n in range(pdfium.FPDFPath_CountSegments(path)):
            x, y = ctypes.c_float(), ctypes.c_float()
            pdfium.FPDFPathSegment_GetPoint(pdfium.FPDFPath_GetPathSegment(path, n), x, y)
            ends += [x.value / MM, y.value / MM]
        found.append(ends)
    return found


def texts(path):
    """The words of each page."""
    document = pypdfium2.PdfDocument(path)
    found = [page.get_textpage().get_text_bounded() for page in document]
    document.close()
    return found
