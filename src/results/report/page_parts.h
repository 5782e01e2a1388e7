#pragma once

/// The parts of pages that the sections are made of, by their names alone.

#include "results/page/agreement_chart.h"
#include "results/page/html.h"
#include "results/page/mounting_drawing.h"

namespace imuscope::report {

using page::agreement_chart;
using page::AgreementPoint;
using page::AgreementSeries;
using page::DrawnImu;
using page::element;
using page::figure_place;
using page::fold;
using page::heading;
using page::Html;
using page::json_for_script;
using page::link_to_heading;
using page::list_of;
using page::mounting_drawing;
using page::page_without_script;
using page::paragraph;
using page::svg_image;
using page::Table;
using page::text;

}  // namespace imuscope::report
