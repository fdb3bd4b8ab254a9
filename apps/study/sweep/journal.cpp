#include "apps/study/sweep/journal.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>

namespace stipple::study {
namespace {

CsvRow cellsOfLine(const std::string& line) {
    CsvRow row(1);
    for (const char c : line)
        if (c == ',')
            row.emplace_back();
        else
            row.back() += c;
    return row;
}

}  // namespace

std::string csvNumber(double value) {
    if (std::isnan(value)) return "";
    return std::isinf(value) ? (value > 0 ? "inf" : "-inf") : fmt::format("{}", value);
}

double numberOf(const std::string& cell) {
    if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
    double value = std::numeric_limits<double>::quiet_NaN();
    std::from_chars(cell.data(), cell.data() + cell.size(), value);
    return value;
}

std::string csvLine(const CsvRow& row) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) line += (i > 0 ? "," : "") + row[i];
    return line + "\n";
}

std::string csvName(std::string name) {
    for (char& c : name)
        if (c == ',' || c == '"' || static_cast<unsigned char>(c) < 32) c = '_';
    return name;
}

Result<Journal> Journal::open(const std::string& path, const CsvRow& head,
                              const std::function<bool(const CsvRow&)>& keep) {
    Journal journal;
    journal.path_ = path;
    std::ifstream in(path, std::ios::binary);
    if (in) {
        std::stringstream text;
        text << in.rdbuf();
        std::string all = text.str();
        all.resize(all.rfind('\n') == std::string::npos ? 0 : all.rfind('\n') + 1);
        std::istringstream lines(all);
        std::string line;
        if (std::getline(lines, line) && line + "\n" != csvLine(head))
            return fail(ErrorKind::input, "has other columns than this program writes", path,
                        "choose another --output");
        while (std::getline(lines, line)) {
            CsvRow row = cellsOfLine(line);
            if (row.size() == head.size() && (!keep || keep(row))) journal.rows_.push_back(std::move(row));
        }
    }
    // Whole, under another name first: a stop in between loses nothing.
    const std::string fresh = path + ".new";
    {
        std::ofstream out(fresh, std::ios::binary);
        out << csvLine(head);
        for (const CsvRow& row : journal.rows_) out << csvLine(row);
        out.close();
        if (!out) return fail(ErrorKind::output, "cannot be written", path, "choose another --output");
    }
    std::error_code error;
    std::filesystem::rename(fresh, path, error);
    journal.out_.open(path, std::ios::binary | std::ios::app);
    if (error || !journal.out_) return fail(ErrorKind::output, "cannot be written", path, "choose another --output");
    return journal;
}

Result<void> Journal::append(const std::vector<CsvRow>& piece) {
    for (const CsvRow& row : piece) {
        out_ << csvLine(row);
        rows_.push_back(row);
    }
    out_.flush();
    if (!out_) return fail(ErrorKind::output, "cannot be written", path_, "is the disk full?");
    return {};
}

}  // namespace stipple::study
