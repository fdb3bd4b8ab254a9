// A CSV file that grows by whole pieces of work, each written out before the next begins. A study that was stopped, by
// whatever, reads what is there and goes on; a torn last line counts as not written.
#pragma once

#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/result.h"

namespace stipple::study {

/// Cells of one line. Values hold neither commas nor quotes nor line breaks: the writers see to that.
using CsvRow = std::vector<std::string>;

class Journal {
  public:
    /// Reads what is there; `keep` says which rows belong to finished work. All others are taken out of the file. A
    /// file with another head is an error (input).
    static Result<Journal> open(const std::string& path, const CsvRow& head,
                                const std::function<bool(const CsvRow&)>& keep = {});
    const std::vector<CsvRow>& rows() const { return rows_; }
    /// Adds a piece of work. Error: it cannot be written.
    Result<void> append(const std::vector<CsvRow>& piece);

  private:
    std::string path_;
    std::vector<CsvRow> rows_;
    std::ofstream out_;
};

/// A number as CSV has it: the shortest text that gives it back; nan is an empty cell.
std::string csvNumber(double value);
double numberOf(const std::string& cell);  ///< empty: nan
std::string csvLine(const CsvRow& row);
/// A name without what would break a line.
std::string csvName(std::string name);

}  // namespace stipple::study
