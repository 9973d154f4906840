//! The page of a diagnosis says what its JSON document says, and its figures agree with each other.

use serde_json::Value;

use crate::common::{CREEP, LEAK, Made, NOTHING, diagnosis, parameter};

/// What stands between each `from` and the next `to`.
fn between<'a>(text: &'a str, from: &str, to: &str) -> Vec<&'a str> {
    text.split(from).skip(1).filter_map(|rest| Some(rest.split_once(to)?.0)).collect()
}

fn section<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.find(&format!("id=\"{id}\"><h2>")).unwrap_or_else(|| panic!("no section {id}"));
    page[start..].split_once("</section>").unwrap().0
}

fn numbers(texts: &[&str]) -> Vec<f64> {
    texts.iter().map(|t| t.replace('−', "-").trim().parse().unwrap_or_else(|_| panic!("no number: {t}"))).collect()
}

fn candidates(answer: &Value) -> &Vec<Value> {
    answer["candidates"].as_array().unwrap()
}

/// The ranking of the last diagnosis is that of the answer, and what is left to none of the candidates makes up the
/// whole.
fn ranking_is_of(page: &str, answer: &Value) {
    let last = section(page, "ranking").rsplit("<h3>").next().unwrap();
    let shown = numbers(&between(last, "data-probability=\"", "\""));
    let names = between(last, "<code class=\"nowrap\">", "</code>");
    assert_eq!(names.len(), candidates(answer).len());
    assert!((shown.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{shown:?}");
    let rows: Vec<&str> = last.split("<tr>").filter(|row| row.contains("<code")).collect();
    for (row, candidate) in rows.iter().zip(candidates(answer)) {
        let effect = candidate["effect"].as_str().unwrap();
        let probability = numbers(&between(row, "data-probability=\"", "\""))[0];
        assert!(between(row, "<code class=\"nowrap\">", "</code>")[0].starts_with(effect), "{effect}: {row}");
        assert!((probability - candidate["probability"].as_f64().unwrap()).abs() < 1e-9, "{effect}: {row}");
        for parameter in candidate["parameters"].as_array().unwrap() {
            assert!(row.contains(&format!("{} = ", parameter["name"].as_str().unwrap())), "{parameter}: {row}");
        }
    }
    for effect in answer["not_tried"].as_array().unwrap() {
        let (name, reason) = (effect["effect"].as_str().unwrap(), effect["reason"].as_str().unwrap());
        assert!(last.contains(&format!("<code>{name}</code>: {reason}")), "{name} was not tried: {reason}");
    }
    for sentence in answer["fails"].as_array().unwrap() {
        assert!(section(page, "failings").contains(sentence.as_str().unwrap()), "{sentence}");
    }
    assert!(page.contains(&format!("data-verdict=\"{}\"", answer["verdict"].as_str().unwrap())));
}

/// Cells of a sensor in the heat map of the n-th model, in times the noise.
fn cells(page: &str, model: usize, sensor: &str) -> Vec<f64> {
    let map = section(page, "heat").split("<figure").nth(model + 1).unwrap();
    let rows = between(map, "<tr><th scope=\"row\">", "</tr>");
    let own: Vec<&&str> = rows.iter().filter(|r| r.starts_with(sensor)).collect();
    own.iter()
        .flat_map(|r| between(r, "<td class=\"cell ", "</td>"))
        .map(|c| c.split_once('>').unwrap().1)
        .map(|t| t.parse().unwrap())
        .collect()
}

/// Rows of the table of errors, as numbers behind the model's name.
fn errors(page: &str) -> Vec<Vec<f64>> {
    let rows = section(page, "errors").split("<tr>").filter(|r| r.contains("<td"));
    rows.map(|r| {
        numbers(
            &between(r, "<td class=\"number\"", "</td>")
                .iter()
                .map(|c| c.split_once('>').unwrap().1)
                .collect::<Vec<_>>(),
        )
    })
    .collect()
}

#[test]
#[ignore = "takes 17 s; CI runs it at night"]
fn creep_to_its_end_is_a_staircase_down_to_the_noise() {
    let Made { answer, file: page } = diagnosis(&[CREEP, "--until-done"]);
    assert_eq!(answer["verdict"], "nothing-missing", "the last diagnosis");
    ranking_is_of(page, answer);

    let stairs = section(page, "errors").split_once("</div>\n</div>").unwrap().0;
    let dots = numbers(&between(stairs, "class=\"dot\" style=\"left:", "%"));
    let floors = numbers(&between(stairs, "class=\"floor\" style=\"left:", "%"));
    assert_eq!((dots.len(), floors.len()), (2, 2), "two models, each with the noise");
    assert!(dots[0] > 2.0 * floors[0] && dots[1] < dots[0] && (dots[1] - floors[1]).abs() < 1.0, "{dots:?} {floors:?}");
    let table = errors(page);
    assert!((table[1][0] / answer["start"]["rmse_m"].as_f64().unwrap() - 1.0).abs() < 0.02, "{table:?}");
    assert!((table[1][1] / answer["start"]["noise_m"].as_f64().unwrap() - 1.0).abs() < 0.02, "{table:?}");

    // The cycles of a sensor are as bad together as the sensor is as a whole.
    for (model, row) in table.iter().enumerate() {
        for (i, sensor) in ["P1", "P2", "P3"].into_iter().enumerate() {
            let cells = cells(page, model, sensor);
            assert_eq!(cells.len(), 8, "{sensor}: a cell a cycle");
            let rms = (cells.iter().map(|c| c * c).sum::<f64>() / 8.0).sqrt();
            assert!((rms / row[3 + i] - 1.0).abs() < 0.06, "model {model}, {sensor}: {rms} against {}", row[3 + i]);
        }
    }

    let books = section(page, "energy").split("class=\"book\"").skip(1);
    let shares: Vec<Vec<f64>> = books.map(|b| numbers(&between(b, "data-share=\"", "\""))).collect();
    assert!(
        shares.len() >= 3 && shares.iter().all(|s| s.len() == 4 && (s.iter().sum::<f64>() - 1.0).abs() < 1e-6),
        "{shares:?}"
    );
    assert!(shares.windows(2).all(|w| w[1][0] > w[0][0]), "the wall takes more and more: {shares:?}");

    let rows = between(section(page, "correlation"), "<tr><th scope=\"row\">", "</tr>");
    let matrix: Vec<Vec<f64>> = rows
        .iter()
        .map(|r| {
            numbers(
                &between(r, "<td class=\"cell ", "</td>")
                    .iter()
                    .map(|c| c.split_once('>').unwrap().1)
                    .collect::<Vec<_>>(),
            )
        })
        .collect();
    assert!(matrix.len() >= 10);
    for (i, row) in matrix.iter().enumerate() {
        assert_eq!((row.len(), row[i]), (matrix.len(), 1.0));
        assert!(row.iter().enumerate().all(|(j, r)| r.abs() <= 1.0 && *r == matrix[j][i]), "{row:?}");
    }
    assert_eq!(section(page, "spectrum").matches("<svg").count(), 3);
    assert_eq!(section(page, "signature").matches("<svg").count(), 3);
}

/// The leak lies at 57.43 m.
#[test]
#[ignore = "takes 20 s; CI runs it at night"]
fn a_leak_stands_first_with_its_place_and_its_signature() {
    let Made { answer, file: page } = diagnosis(&[LEAK, "--effects", "unsteady-friction"]);
    ranking_is_of(page, answer);
    let best = &candidates(answer)[0];
    assert_eq!(best["effect"], "leak");
    let place = parameter(best, "leak_position_m");
    let ranking = section(page, "ranking");
    assert!(ranking.contains(&format!("leak_position_m = {:.1}", place["value"].as_f64().unwrap())), "{place}");
    assert!(
        ranking.contains("<strong>Next test:</strong> none is needed: these recordings distinguish the candidates.")
    );
    assert!(between(page, "<p class=\"verdict", "</p>")[0].contains("Missing: leak (probability &gt; 0.99)."));
    let shares = numbers(&between(section(page, "signature"), "explains ", " %"));
    assert!(shares.len() == 2 && shares.iter().all(|s| (90.0..=100.0).contains(s)), "{shares:?}");
    let titles = between(section(page, "errors"), "<span class=\"name\">", "</span>");
    assert_eq!(titles[..2], ["+ unsteady-friction", "+ unsteady-friction + leak"]);
    let table = errors(page);
    for (row, rmse_m) in table.iter().zip([&answer["start"]["rmse_m"], &best["rmse_m"]]) {
        assert!((row[0] / rmse_m.as_f64().unwrap() - 1.0).abs() < 0.02, "{table:?}");
    }
    assert!(cells(page, 0, "P1").iter().all(|c| *c > 3.0) && cells(page, 1, "P1").iter().all(|c| *c < 1.5));
}

#[test]
fn where_nothing_is_missing_the_page_says_so_and_shows_no_signature() {
    let Made { answer, file: page } = diagnosis(&[NOTHING, "--effects", "viscoelastic-wall"]);
    ranking_is_of(page, answer);
    let verdict = between(page, "<p class=\"verdict", "</p>")[0];
    assert!(
        verdict.contains("good") && verdict.contains("Nothing is missing from the base model + viscoelastic-wall:3")
    );
    let tried = candidates(answer).len();
    assert!(
        section(page, "ranking").contains(&format!("None of the {tried} effects that were tried is worth adding."))
    );
    assert!(section(page, "failings").contains("Nowhere: its residual is noise"));
    assert!(!page.contains("id=\"signature\""));
    assert_eq!(section(page, "errors").matches("class=\"dot\"").count(), 1);
}
